/* SPDX-License-Identifier: BSD-3-Clause */
/* How search orders what it finds: a title that has the words as they were typed comes first. */
Scorer = {
  score: ([, title, , , score]) => {
    const words = new URLSearchParams(window.location.search).get("q") || "";
    return title.toLowerCase().includes(words.toLowerCase().trim()) ? score + 100 : score;
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
