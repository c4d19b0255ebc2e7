"""A catalogue that says everything a catalogue can say: every key of every level stands in it."""

COMPLETE = """
schema: 1
name: glassware
parameters: {depth: {rounds: 2}}
objects:
  - id: wine-glass
    truth_model: truth/model.ply
    parameters: {depth: {rounds: 3}}
    captures:
      - id: front
        frames: front.mp4
        spheres: [{x: 344, y: 126.5, radius: 42.0, diameter_mm: 25.0}]
        camera: {matrix: [[900, 0, 320], [0, 900, 240], [0, 0, 1]]}
        region: {x: 16, y: 16, width: 251, height: 221}
        mask: ../masks/front.png
        markup: s3://bucket/markup.json
        pose: {turntable: 30}
        pixel_size: 0.21
        truth: front/truth
        parameters: {depth: {rounds: 4}}
      - id: back
        frames: /absolute/img_*.png
        lights: lights.lp
        pose: {camera_to_world: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]}
"""
