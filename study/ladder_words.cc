#include "study/ladder_words.h"

#include <fmt/format.h>

#include <cmath>

#include "base/count.h"

namespace unfurl::study {

void AddLadderWords(const correlate::LadderResult& ladder, data::FitRecord* record) {
  if (!ladder.used) return;
  const std::size_t top = ladder.names.size() - 1;
  std::string words;
  if (ladder.base == top) {
    words = fmt::format("Fitted with {} itself, {} of it.", ladder.names[top],
                        Counted(ladder.runs.back(), "run"));
  } else {
    words =
        fmt::format("Solved with {} and led to {} by its difference: {}", ladder.names[ladder.base],
                    ladder.names[top], Counted(ladder.rounds.size(), "round"));
    if (!ladder.rounds.empty() && std::isfinite(ladder.rounds.back().step)) {
      words += fmt::format(", the last look {:.2g} standard errors from the one before",
                           ladder.rounds.back().step);
    }
    words += ".";
  }
  record->reasons.push_back(words);
  if (ladder.one_sided) {
    record->reasons.push_back(
        "Two estimates of what the finest rung lacks agree, so the 95% intervals reach to where it "
        "would move the values, and not as far to the other side.");
  }
  if (ladder.followed > 0) {
    record->reasons.push_back(
        fmt::format("What the finest rung lacks moves the values by more than data and doubt: the "
                    "way there was followed, in {} round{}.",
                    ladder.followed, ladder.followed == 1 ? "" : "s"));
  }
  if (ladder.rules) {
    record->reasons.push_back(
        "What the finest rung lacks is more than ten times what the data leave open: no profile "
        "was followed, the data's intervals are 1.96 standard errors.");
  }
  for (const std::string& note : ladder.notes) record->reasons.push_back("Ladder: " + note + ".");
}

}  // namespace unfurl::study
