#include "study/between_words.h"

#include <fmt/format.h>

namespace unfurl::study {

std::string BetweenWords(const correlate::TrialResult& t, const std::string& of) {
  using Told = correlate::BetweenSamples::Told;
  if (t.between.samples == 0 || t.between.told == Told::kBySize) return "";
  const std::string moves = fmt::format(
      "Between {} of the samples{} the model moves by what they do not show, {:.2g} times the "
      "residuals: ",
      t.between.samples, of, t.between.times);
  if (t.between.told == Told::kOneMinimum) {
    return moves + "starts over what the others leave open came back to the same minimum.";
  }
  if (t.between.told == Told::kByWhatShows) {
    return moves +
           "another minimum may pass through them as well. The standard errors and intervals are "
           "those of the samples that show the motion. Sample faster.";
  }
  if (t.between.told == Told::kBySearch) {
    return moves + "the bounds were looked over for another minimum that passes through them.";
  }
  return moves + "what is left of another minimum would look like noise there. " +
         (t.goodness.hidden
              ? "So noise cannot be told from a misfit, and residuals beyond the stated sigma are "
                "not taken for it."
              : "Sample faster, or state the sigma.");
}

}  // namespace unfurl::study
