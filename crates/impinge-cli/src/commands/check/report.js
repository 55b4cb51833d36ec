const table = document.querySelector("table"), body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
const value = (row, ix) => row.cells[ix].dataset.v ?? "";
function sort(ix, descending) {
  const order = (a, b) => {
    const [x, y] = [value(a, ix), value(b, ix)];
    if (x === "" || y === "") return (x === "") - (y === "");
    const by = isNaN(x) || isNaN(y) ? x.localeCompare(y, undefined, { numeric: true }) : x - y;
    return descending ? -by : by;
  };
  body.append(...[...body.rows].sort(order));
  heads.forEach((head, at) => head.setAttribute("aria-sort", at !== ix ? "none" : descending ? "descending" : "ascending"));
}
heads.forEach((head, ix) => {
  if (!ix) return;
  head.tabIndex = 0;
  const first = ix > 1;
  head.onclick = () => sort(ix, head.ariaSort === "descending" ? false : head.ariaSort === "ascending" ? true : first);
  head.onkeydown = (event) => event.key === "Enter" && head.onclick();
});
document.querySelector("select").onchange = (event) => sort(+event.target.value, event.target.value > 1);
