#include "measure/light_fault.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/text.h"

namespace unfurl::measure {

namespace {

// "30.2 +- 0.5" with the value's sign left out: to the second digit of the sigma.
std::string Amount(double value, double sigma) {
  const int digits =
      sigma > 0.0 ? std::clamp(1 - static_cast<int>(std::floor(std::log10(sigma))), 0, 6) : 3;
  return fmt::format("{:.{}f} +- {:.{}f}", std::abs(value), digits, sigma, digits);
}

std::string SubjectOf(const LightSubject& of, double size, std::span<const std::string> cameras,
                      std::span<const std::string> marks) {
  const char* light = size < 0.0 ? "dimmer" : "brighter";
  const auto camera = [&] { return cameras[static_cast<std::size_t>(of.camera)]; };
  const auto mark = [&] { return marks[static_cast<std::size_t>(of.mark)]; };
  switch (of.kind) {
    case LightKind::kLed:
      return fmt::format("the LED of mark {} is {}", mark(), light);
    case LightKind::kGain:
      return fmt::format("camera {} sees all marks {}", camera(), light);
    case LightKind::kFocus:
      return fmt::format("camera {}'s spots are {}", camera(), size < 0.0 ? "narrower" : "wider");
    case LightKind::kAll:
      return fmt::format("all marks are {} in all cameras", light);
    case LightKind::kView:
      break;
  }
  return fmt::format("only mark {} is so in camera {}", mark(), camera());
}

}  // namespace

const char* Name(LightKind kind) {
  constexpr std::array<const char*, 5> kNames = {"led", "gain", "focus", "all_light", "view"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string Describe(const LightFault& fault, std::span<const std::string> cameras,
                     std::span<const std::string> marks) {
  const double middle = 0.5 * (fault.earliest + fault.latest);
  const double half = 0.5 * (fault.latest - fault.earliest);
  std::string text =
      fmt::format("{} by {}% {} {} s", SubjectOf(fault.subject, fault.size, cameras, marks),
                  Amount(100.0 * fault.size, 100.0 * fault.sigma),
                  fault.until > fault.latest ? "from" : "since", Amount(middle, half));
  if (fault.until > fault.latest)
    text += fmt::format(" to {:.4g} s, little by little", fault.until);
  if (fault.certain()) return text;
  std::vector<std::string> others;
  for (const LightSubject& one : fault.rivals) {
    others.push_back(SubjectOf(one, fault.size, cameras, marks));
  }
  return text + fmt::format(", or {}: it cannot be told which", JoinWords(others));
}

}  // namespace unfurl::measure
