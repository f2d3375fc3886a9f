// The specification of a link, as its page in the book has it: the text of a clause, or of a section.

export class Specification {
  constructor(link) {
    this.page = `../reference/${link}.html`;
    this.text = fetch(this.page).then((found) => found.text()).then((text) => new DOMParser().parseFromString(text, "text/html"));
  }

  /** Shows a clause (`IB-6`) or a section (`4.2`) in an element, with the row of a table that has this name. */
  async show(place, name, into) {
    into.dataset.place = place;
    const page = await this.text;
    if (into.dataset.place !== place) return; // another was asked for meanwhile
    const isSection = /^\d/.test(place);
    const found = isSection ? section(page, place) : clause(page, place);
    const title = document.createElement("h2");
    const link = document.createElement("a");
    link.href = `${this.page}#${isSection ? found.id : place}`;
    link.textContent = isSection ? found.title : place;
    title.append(link);
    const nodes = found.nodes.map((node) => this.copy(node));
    into.replaceChildren(title, ...nodes);
    highlight(into, name);
    const named = into.querySelector("tr.named");
    into.scrollTop = named ? named.offsetTop + named.offsetParent.offsetTop - into.clientHeight / 2 : 0;
  }

  copy(node) {
    const copy = document.importNode(node, true);
    for (const it of copy.querySelectorAll("[id]")) it.removeAttribute("id");
    for (const link of copy.querySelectorAll("a[href]")) {
      link.href = new URL(link.getAttribute("href"), new URL(this.page, location.href)).href;
    }
    return copy;
  }
}

/** The clause, with the table that it introduces. */
function clause(page, place) {
  const anchor = page.getElementById(place);
  const item = anchor?.closest("li") ?? anchor?.closest("p");
  if (!item) return { nodes: [] };
  const nodes = [item];
  for (let next = item.nextElementSibling; item.tagName === "P" && isTable(next); next = next.nextElementSibling) nodes.push(next);
  return { nodes };
}

/** What a section has before its clauses: texts, tables, pictures. */
function section(page, place) {
  const heading = [...page.querySelectorAll("h2, h3")].find((it) => it.textContent.trim().split(/[. ]+(?=\D|$)/)[0] === place);
  const nodes = [];
  for (let next = heading?.nextElementSibling; next && !/^H\d$/.test(next.tagName); next = next.nextElementSibling) {
    if (!next.querySelector("a[id]")) nodes.push(next);
  }
  return { title: heading?.textContent ?? place, id: heading?.id ?? "", nodes };
}

const isTable = (node) => node?.matches(".table-wrapper, table") ?? false;

/** Marks the rows of tables that have the name of a field as a word. */
function highlight(into, name) {
  const words = name.split(".").filter((word) => !/^\d+$/.test(word)).map((word) => word.replaceAll("_", "[_ ]"));
  if (!words.length) return;
  const pattern = new RegExp(`(^|[^a-z_])${words.at(-1)}([^a-z_]|$)`, "i");
  const isNamed = (row) => [...row.cells].some((cell) => pattern.test(cell.textContent));
  for (const row of into.querySelectorAll("tbody tr")) row.classList.toggle("named", isNamed(row));
}
