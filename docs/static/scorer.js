/* SPDX-License-Identifier: BSD-3-Clause */
/* How search orders what it finds. First come pages that say that they answer these words (SEARCHED
   in tools/website/contents.py) and things of this very name, then pages whose title has the words.
   References of Python and C++ and decisions come last: whoever wants them knows their names. */
Scorer = {
  score: ([page, title, , , score, , kind]) => {
    const typed = (new URLSearchParams(window.location.search).get("q") || "").trim().toLowerCase();
    const stems = (text) => {
      const stemmer = new Stemmer();
      return splitQuery(text.toLowerCase()).map((word) => stemmer.stemWord(word));
    };
    const name = title.toLowerCase();
    const isName = name === typed || [".", " "].some((before) => name.endsWith(before + typed));
    if (kind === "object") return isName ? score + 100 : score;
    if (/^(reference\/(python|cpp)|decisions|results|source|changelog|architecture)\b/.test(page)) {
      return score;
    }
    if (!Scorer.answers) {
      Scorer.answers = {};
      for (const [entry, places] of Object.entries(Search._index.indexentries)) {
        for (const [file] of places) {
          const words = (Scorer.answers[Search._index.docnames[file]] ??= new Set());
          stems(entry).forEach((stem) => words.add(stem));
        }
      }
    }
    const wanted = stems(typed);
    const answered = wanted.filter((stem) => Scorer.answers[page]?.has(stem)).length;
    return (
      score
      + 20
      + (kind === "index" ? 100 : 0)
      + (100 * answered) / Math.max(1, wanted.length)
      + (isName ? 100 : name.includes(typed) ? 40 : 0)
    );
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
