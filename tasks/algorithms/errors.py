"""The one way in which an algorithm says that a capture cannot be worked on."""


class UnusableCapture(Exception):
    """The data cannot give a result: `message` names the offending value, `remedy` says what to do about it."""

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(f"{message}: {remedy}")
        self.message = message
        self.remedy = remedy

    def __reduce__(self) -> tuple[type["UnusableCapture"], tuple[str, str]]:
        """Survive the journey back from a worker process with both texts."""
        return type(self), (self.message, self.remedy)


class UnusableSphere(UnusableCapture):
    """No chrome sphere shows the lights: there is none, or it lies elsewhere than is thought."""


class UnusableFrames(UnusableCapture):
    """The frames are too few, or dark: no correction of the inputs helps, only another recording."""
