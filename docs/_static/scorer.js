// How the search ranks what it finds. Pages that explain come before those that list, and both
// before the record of what was decided, measured and changed.
var Scorer = {
  score: ([name, , , , score]) => {
    if (/^(design|results)\/|^generated\/(changelog|web|driver-|policy-|rllib)/.test(name)) return score - 3;
    return name.startsWith("generated/") ? score : score + 3;
  },
  objNameMatch: 8,
  objPartialMatch: 3,
  objPrio: { 0: 0, 1: 0, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
