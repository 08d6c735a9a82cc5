#include "base/number.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace unfurl {
namespace {

constexpr char kMinus[] = "\u2212";
constexpr char kNone[] = "\u2013";

std::string Signed(double value, const std::string& digits) {
  // A value that rounds to zero has no sign.
  const bool zero = digits.find_first_of("123456789") == std::string::npos;
  return (value < 0.0 && !zero ? kMinus : "") + digits;
}

// The decade of |value| once it is rounded to `significant` digits: 9.996 at 3 digits is in 10.
int Decade(double value, int significant) {
  const std::string text = fmt::format("{:.{}e}", std::abs(value), significant - 1);
  return std::stoi(text.substr(text.find('e') + 1));
}

}  // namespace

std::string Number(double value, int significant) {
  if (std::isnan(value)) return kNone;
  if (std::isinf(value))
    return Signed(value, "\u221e") == "\u221e" && value < 0 ? std::string(kMinus) + "\u221e"
                                                            : "\u221e";
  if (value == 0.0) return "0";
  const int decade = Decade(value, significant);
  if (decade < -4 || decade >= 7) {
    const std::string text = fmt::format("{:.{}e}", std::abs(value), significant - 1);
    return Signed(value, text.substr(0, text.find('e'))) + "e" + (decade < 0 ? kMinus : "") +
           std::to_string(std::abs(decade));
  }
  return Signed(value,
                fmt::format("{:.{}f}", std::abs(value), std::max(0, significant - 1 - decade)));
}

int IntervalDigits(double low, double high, int least) {
  constexpr int kOfDouble = 17;  // that bring every double back
  constexpr int kOfWidth = 2;    // the last is good to a tenth of it
  const double width = high - low, size = std::max(std::abs(low), std::abs(high));
  if (!(width > 0.0) || !std::isfinite(width)) return least;
  const int wanted = static_cast<int>(std::ceil(std::log10(size / width))) + kOfWidth;
  return std::clamp(wanted, least, kOfDouble);
}

std::string IntervalEnd(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}g}", value, digits) : "open";
}

std::string IntervalText(double low, double high, int least) {
  const int digits = IntervalDigits(low, high, least);
  return IntervalEnd(low, digits) + " to " + IntervalEnd(high, digits);
}

std::string UnitAfter(const std::string& unit) {
  return unit.empty() || unit == "1" ? std::string() : " " + unit;
}

std::string NumberWithError(double value, double sigma, int significant) {
  if (!std::isfinite(value) || !std::isfinite(sigma) || sigma <= 0.0) {
    return Number(value, significant);
  }
  const int error_decade = Decade(sigma, 2);
  const int value_decade = value == 0.0 ? error_decade : Decade(value, 2);
  const int largest = std::max(error_decade, value_decade);
  if (largest < -4 || largest >= 7) {
    // One power of ten for both, so that they can be compared at a glance.
    const double unit = std::pow(10.0, largest);
    const int places = largest - error_decade + 1;
    return fmt::format("({} \u00b1 {:.{}f})e{}{}",
                       Signed(value, fmt::format("{:.{}f}", std::abs(value) / unit, places)),
                       sigma / unit, places, largest < 0 ? kMinus : "", std::abs(largest));
  }
  const int places = std::max(0, 1 - error_decade);
  return fmt::format("{} \u00b1 {:.{}f}",
                     Signed(value, fmt::format("{:.{}f}", std::abs(value), places)), sigma, places);
}

}  // namespace unfurl
