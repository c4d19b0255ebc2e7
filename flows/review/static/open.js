// Exchanges the link's token, or a password, for the cookie, and goes on to the page.

const message = document.getElementById("message");
const form = document.getElementById("form");

// A bookmark of a view keeps its place after # where this page is shown instead of it.
const place = location.hash.startsWith("#/") ? location.hash : "";

async function enter(token) {
  const answer = await fetch("/api/session", { method: "POST", body: token }).catch(() => null);
  if (answer?.ok) {
    location.replace(`/${place}`);
    return;
  }
  message.textContent = answer
    ? "This link is of an earlier start, or the password is wrong. Open the link that was printed last."
    : "The server does not answer: start glint review again.";
  form.hidden = false;
  document.getElementById("password").focus();
}

const token = place ? "" : location.hash.slice(1);
history.replaceState(null, "", location.pathname);
if (token) {
  enter(token);
} else {
  message.textContent = "Open the link that glint review printed.";
  form.hidden = false;
}
form.addEventListener("submit", (event) => {
  event.preventDefault();
  enter(document.getElementById("password").value);
});
