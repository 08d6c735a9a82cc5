#include "data/units.h"

#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>

#include "base/text.h"

namespace unfurl::data {

namespace {

// Exponents of metre, kilogram, second and radian.
using Dimension = std::array<int, 4>;

struct Measure {
  double size = 1.0;  // in SI
  Dimension of{};
};

const std::map<std::string, Measure, std::less<>>& Known() {
  constexpr double kPi = std::numbers::pi;
  constexpr double kPound = 0.45359237;  // [kg], by definition
  constexpr double kGravity = 9.80665;   // standard acceleration of gravity, by definition [m/s^2]
  static const std::map<std::string, Measure, std::less<>> known = {
      {"1", {1.0, {}}},
      {"%", {1e-2, {}}},
      {"m", {1.0, {1, 0, 0, 0}}},
      {"mm", {1e-3, {1, 0, 0, 0}}},
      {"um", {1e-6, {1, 0, 0, 0}}},
      {"cm", {1e-2, {1, 0, 0, 0}}},
      {"km", {1e3, {1, 0, 0, 0}}},
      {"in", {0.0254, {1, 0, 0, 0}}},
      {"ft", {0.3048, {1, 0, 0, 0}}},
      {"kg", {1.0, {0, 1, 0, 0}}},
      {"g", {1e-3, {0, 1, 0, 0}}},
      {"s", {1.0, {0, 0, 1, 0}}},
      {"ms", {1e-3, {0, 0, 1, 0}}},
      {"us", {1e-6, {0, 0, 1, 0}}},
      {"min", {60.0, {0, 0, 1, 0}}},
      {"h", {3600.0, {0, 0, 1, 0}}},
      {"Hz", {1.0, {0, 0, -1, 0}}},
      {"rad", {1.0, {0, 0, 0, 1}}},
      {"mrad", {1e-3, {0, 0, 0, 1}}},
      {"deg", {kPi / 180.0, {0, 0, 0, 1}}},
      {"gon", {kPi / 200.0, {0, 0, 0, 1}}},
      {"mgon", {kPi / 200e3, {0, 0, 0, 1}}},
      {"arcsec", {kPi / 648e3, {0, 0, 0, 1}}},
      {"rev", {2.0 * kPi, {0, 0, 0, 1}}},
      {"rpm", {2.0 * kPi / 60.0, {0, 0, -1, 1}}},
      {"gn", {kGravity, {1, 0, -2, 0}}},
      {"N", {1.0, {1, 1, -2, 0}}},
      {"mN", {1e-3, {1, 1, -2, 0}}},
      {"kN", {1e3, {1, 1, -2, 0}}},
      {"lbf", {kPound * kGravity, {1, 1, -2, 0}}},
      {"J", {1.0, {2, 1, -2, 0}}},
      {"W", {1.0, {2, 1, -3, 0}}},
  };
  return known;
}

// "m/s^2", "N m", "N*mm", "1/m".
std::optional<Measure> Parse(const std::string& text) {
  Measure out;
  int sign = 1;
  std::string word;
  auto take = [&]() {
    if (word.empty()) return true;
    int power = 1;
    const std::size_t hat = word.find('^');
    if (hat != std::string::npos) {
      char* end = nullptr;
      const std::string digits = word.substr(hat + 1);
      power = static_cast<int>(std::strtol(digits.c_str(), &end, 10));
      constexpr int kHighest = 9;  // no unit of the field is of a higher power
      if (digits.empty() || *end != '\0' || std::abs(power) > kHighest) return false;
      word.resize(hat);
    }
    const auto found = Known().find(word);
    word.clear();
    if (found == Known().end()) return false;
    out.size *= std::pow(found->second.size, sign * power);
    for (std::size_t i = 0; i < out.of.size(); ++i) out.of[i] += sign * power * found->second.of[i];
    return true;
  };
  for (const char c : text) {
    if (c != ' ' && c != '*' && c != '/') {
      word += c;
      continue;
    }
    if (!take()) return std::nullopt;
    if (c == '/') {
      if (sign < 0) return std::nullopt;  // a/b/c means this to some, and that to others
      sign = -1;
    }
  }
  if (!take()) return std::nullopt;
  return out;
}

}  // namespace

std::optional<double> UnitsPer(const std::string& unit, const std::string& of) {
  const std::string a(Trim(unit)), b(Trim(of));
  if (a == b) return 1.0;
  const auto from = Parse(a), to = Parse(b);
  if (!from || !to || from->of != to->of) return std::nullopt;
  return to->size / from->size;
}

}  // namespace unfurl::data
