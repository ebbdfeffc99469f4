// The token stands behind the # of the link, which no browser sends or logs; here it becomes a
// cookie that no script can read, and leaves the address line.
const said = document.getElementById("said");
const token = location.hash.slice(1);
history.replaceState(null, "", "/login");

async function enter() {
  if (!token) {
    said.textContent = "Open the link that turnscan printed last.";
    return;
  }
  const answer = await fetch("/login", {
    method: "POST",
    headers: { "Content-Type": "application/json", "X-Turnscan": "1" },
    body: JSON.stringify({ token }),
  });
  if (answer.ok) {
    location.replace("/");
    return;
  }
  const problem = await answer.json();
  said.textContent = problem.hint ? `${problem.text}: ${problem.hint}.` : `${problem.text}.`;
}

enter().catch(() => {
  said.textContent = "turnscan does not answer. Is it still running?";
});
