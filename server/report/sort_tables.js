
"use strict";
/* A table that sorts: a click on the name of a column, or Enter there, puts the largest first, a second one the least. */
for (const table of document.querySelectorAll("table.sorts")) {
  const heads = [...table.querySelectorAll("thead th")].filter(head => head.textContent !== "");
  heads.forEach(head => {
    const column = head.cellIndex, value = row => row.cells[column] ? row.cells[column].textContent : "";
    const order = (a, b) => {
      const x = value(a), y = value(b), apart = parseFloat(x) - parseFloat(y);
      return Number.isNaN(apart) ? x.localeCompare(y, undefined, {numeric: true}) : apart;
    };
    const sort = () => {
      const sign = head.getAttribute("aria-sort") === "descending" ? 1 : -1;
      heads.forEach(other => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", sign < 0 ? "descending" : "ascending");
      [...table.tBodies[0].rows].sort((a, b) => sign * order(a, b)).forEach(row => table.tBodies[0].append(row));
    };
    head.tabIndex = 0;
    head.addEventListener("click", sort);
    head.addEventListener("keydown", e => { if (e.key === "Enter") sort(); });
  });
}
