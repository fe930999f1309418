/* SPDX-License-Identifier: BSD-3-Clause */
/* How search orders what it finds: pages that say that they answer these words come first (SEARCHED
   in tools/website/contents.py), then titles that have the words as they were typed. */
Scorer = {
  score: ([, title, , , score, , kind]) => {
    const words = new URLSearchParams(window.location.search).get("q") || "";
    const isTitle = title.toLowerCase().includes(words.toLowerCase().trim());
    return kind === "index" || isTitle ? score + 100 : score;
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
