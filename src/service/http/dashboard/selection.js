// Which rows of a table are selected, by mouse and by keyboard: Space selects, the arrows go from row to row, with
// Shift they take rows along.

/** `rows()` are the rows in order, each with an `id` and a `box` (its checkbox). `changed` is told of the ids. */
export class Selection {
  #chosen = new Set();
  #anchor = null;

  constructor(rows, changed) {
    this.rows = rows;
    this.changed = changed;
  }

  get ids() {
    return [...this.#chosen];
  }

  has(id) {
    return this.#chosen.has(id);
  }

  /** Forgets rows that are no longer there. */
  keep(known) {
    const before = this.#chosen.size;
    this.#chosen = new Set(this.ids.filter((id) => known.has(id)));
    if (this.#chosen.size !== before) this.changed(this.ids);
  }

  set(rows, on) {
    for (const row of rows) {
      if (on) this.#chosen.add(row.id);
      else this.#chosen.delete(row.id);
      row.box.checked = on;
    }
    this.changed(this.ids);
  }

  clear() {
    this.set(this.rows(), false);
  }

  /** Listens to the checkbox of a row. */
  watch(row) {
    row.box.addEventListener("click", (event) => {
      const rows = this.rows();
      const [from, to] = [rows.findIndex((other) => other.id === this.#anchor), rows.indexOf(row)];
      if (event.shiftKey && from >= 0) {
        this.set(rows.slice(Math.min(from, to), Math.max(from, to) + 1), row.box.checked);
      } else {
        this.set([row], row.box.checked);
      }
      this.#anchor = row.id;
    });
    row.box.addEventListener("keydown", (event) => {
      const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
      if (by) {
        const rows = this.rows();
        const next = rows[rows.indexOf(row) + by];
        if (next) {
          if (event.shiftKey) this.set([row, next], true);
          this.#anchor = next.id;
          next.box.focus();
        }
      } else if (event.key === "a" && (event.ctrlKey || event.metaKey)) {
        this.set(this.rows(), true);
      } else if (event.key === "Escape") {
        this.clear();
      } else {
        return;
      }
      event.preventDefault();
    });
  }
}
