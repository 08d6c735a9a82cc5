#include "correlate/placement.h"

#include <cmath>

#include "base/error.h"
#include "base/text.h"

namespace unfurl::correlate {

namespace {

double NumberOf(std::string_view text, bool positive, const std::string& all,
                const std::string& where, const char* remedy) {
  double value = 0.0;
  if (!ParseDouble(Trim(text), &value) || !std::isfinite(value) || (positive && !(value > 0.0))) {
    throw Error("'" + all + "' says nothing of it", where, remedy);
  }
  return value;
}

}  // namespace

Prior ParsePrior(const std::string& text, const std::string& where) {
  constexpr char kRemedy[] =
      "give free, known (it is 0), a number, or MEAN+-SIGMA with a positive sigma";
  if (text == "free") return Prior::Free();
  if (text == "known") return Prior::Known(0.0);
  const std::size_t at = text.find("+-");
  const std::string_view whole = text;
  const double mean = NumberOf(whole.substr(0, at), false, text, where, kRemedy);
  if (at == std::string::npos) return Prior::Known(mean);
  return Prior::Normal(mean, NumberOf(whole.substr(at + 2), true, text, where, kRemedy));
}

FramePrior ParseFramePrior(const std::string& text, const std::string& where) {
  constexpr char kRemedy[] =
      "give free, known, or SHIFT,ROTATION: their standard deviations in m and rad";
  FramePrior out;
  if (text == "free" || text == "known") {
    out.kind = text == "free" ? Foreknowledge::kFree : Foreknowledge::kKnown;
    return out;
  }
  const std::size_t comma = text.find(',');
  const std::string_view whole = text;
  out.kind = Foreknowledge::kNormal;
  out.sigma_shift = NumberOf(whole.substr(0, comma), true, text, where, kRemedy);
  out.sigma_rotation =
      NumberOf(comma == std::string::npos ? std::string_view() : whole.substr(comma + 1), true,
               text, where, kRemedy);
  return out;
}

}  // namespace unfurl::correlate
