window.troubles = [];
addEventListener("error", (event) => troubles.push(`${event.message} (line ${event.lineno})`));
addEventListener("unhandledrejection", (event) => troubles.push(String(event.reason)));
addEventListener("securitypolicyviolation", (event) => troubles.push(`policy: ${event.violatedDirective} ${event.blockedURI}`));
for (const kind of ["error", "warn"]) console[kind] = (...words) => troubles.push(`console.${kind}: ${words.join(" ")}`);
