#include "calib/check_causes.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/length.h"

namespace unfurl::calib {
namespace {

constexpr std::size_t kMostCauses = 3;  // more: the calibration is not to be mended by names
constexpr double kAlso = 0.05;          // probability of another cause that is worth a word

// The name of a cause, as in "the rest agrees without ...".
std::string NameOf(CauseKind kind, int index, const CheckDesign& design, const Observations& data,
                   const CheckResult& result, bool bar) {
  const auto at = static_cast<std::size_t>(index);
  switch (kind) {
    case CauseKind::kCamera:
      return fmt::format("camera \"{}\"", result.cameras[at].name);
    case CauseKind::kPoint:
      return fmt::format("{} \"{}\"", bar ? "placement" : "point", result.points[at].id);
    case CauseKind::kReading:
      return fmt::format("the reading of {} \"{}\" by camera \"{}\"", bar ? "end" : "point",
                         data.ids[static_cast<std::size_t>(design.point[at])],
                         result.cameras[static_cast<std::size_t>(design.camera[at])].name);
    case CauseKind::kFrame:
      break;
  }
  return bar ? "the stated length" : "the frame of the points";
}

// What a cause amounts to, and what to do about it.
std::string WordsOf(const CheckedCause& cause, bool bar) {
  const std::string pixels = fmt::format("{:+.2f} +- {:.2f} px", cause.size, cause.sigma);
  switch (cause.kind) {
    case CauseKind::kCamera:
      return fmt::format(
          "it has moved; its readings are off by {}. Use the other cameras without it, or "
          "calibrate "
          "again",
          pixels);
    case CauseKind::kPoint:
      if (bar) {
        return fmt::format("the bar is {} too {} there; place it again, the rig may be unchanged",
                           LengthText(std::abs(cause.size)), cause.size > 0.0 ? "long" : "short");
      }
      return fmt::format(
          "it is {} where it was surveyed; measure it again, the rig may be unchanged",
          std::isfinite(cause.size) ? LengthText(cause.size) + " from" : "not");
    case CauseKind::kReading:
      return fmt::format("it is off by {}; measure it again, the rig may be unchanged", pixels);
    case CauseKind::kFrame:
      break;
  }
  if (bar) {
    return fmt::format(
        "on average the bar was found {} +- {} too {}: state its length at its "
        "temperature, or the rig's scale has changed and it is to be calibrated "
        "again",
        LengthText(std::abs(cause.size)), LengthText(cause.sigma),
        cause.size > 0.0 ? "long" : "short");
  }
  return "all points are displaced alike: they were measured in another frame than the rig's, or "
         "all cameras moved together; set the station up in the frame of the survey, or calibrate "
         "again";
}

// How large a cause is, beside what the others do.
CheckedCause Measure(const FoundCause& one, const CheckDesign& design, const JointTest& test,
                     const Eigen::MatrixXd& freed, bool bar, const CheckResult& result) {
  const auto at = static_cast<std::size_t>(one.index);
  CheckedCause cause{one.kind};
  cause.probability = one.probability;
  const auto set = [&](const JointTest::Amount& amount, double sign) {
    cause.size = sign * amount.value;
    cause.sigma = amount.sigma;
  };
  switch (one.kind) {
    case CauseKind::kCamera:
      cause.camera = one.index;
      set({result.cameras[at].shift_px, result.cameras[at].shift_sigma_px}, 1.0);
      break;
    case CauseKind::kPoint:
      cause.point = one.index;
      set({result.points[at].error, result.points[at].predicted}, 1.0);
      // Of a bar the one as found, over its stated length.
      if (bar) set(test.AmountOf(design.by_point[at], freed), -1.0);
      break;
    case CauseKind::kReading:
      cause.camera = design.camera[at];
      cause.point = bar ? design.point[at] / 2 : design.point[at];
      set(test.AmountOf(design.by_reading[at], freed), 1.0);
      break;
    case CauseKind::kFrame:
      if (bar) set(test.AmountOf({0, design.by_frame}, freed), -1.0);
      break;
  }
  return cause;
}

}  // namespace

FoundCauses FindCauses(const data::Rig& rig, const CheckDesign& design, const JointTest& test,
                       const CheckOptions& options) {
  FoundCauses out;
  out.causes = test.FindCauses(HypothesesOf(rig, design, options), options.doubtful, kMostCauses,
                               &out.explained);
  return out;
}

void NameCauses(const data::Rig& rig, const CheckDesign& design, const JointTest& test,
                const FoundCauses& found, const Observations& data, bool bar, CheckResult* result) {
  const std::vector<Hypothesis> hypotheses = HypothesesOf(rig, design, result->options);
  const auto freed_beside = [&](CauseKind kind, int index) {
    std::vector<FoundCause> others;
    for (const FoundCause& one : found.causes) {
      if (one.kind != kind || one.index != index) others.push_back(one);
    }
    return test.Free(hypotheses, others);
  };
  result->explained = found.explained;
  if (found.explained) {
    // Each camera beside what is wrong otherwise.
    const Eigen::MatrixXd shifts = design.Shifts(rig.cameras.size());
    for (std::size_t c = 0; c < result->cameras.size(); ++c) {
      const auto j = static_cast<Eigen::Index>(c);
      const JointTest::Amount shift =
          test.AmountOf({0, shifts.col(j)}, freed_beside(CauseKind::kCamera, static_cast<int>(c)));
      result->cameras[c].shift_px = shift.value;
      result->cameras[c].shift_sigma_px = shift.sigma;
    }
  }
  bool rig_stands = true;
  for (std::size_t k = 0; k < found.causes.size() && result->explained; ++k) {
    const FoundCause& one = found.causes[k];
    CheckedCause cause =
        Measure(one, design, test, freed_beside(one.kind, one.index), bar, *result);
    cause.text = fmt::format(
        "the rest agrees without {} (probability {:.0f}%{}): {}",
        NameOf(one.kind, one.index, design, data, *result, bar), 100.0 * one.probability,
        one.other_index >= 0 && one.other_probability > kAlso
            ? fmt::format("; {:.0f}% without {} instead", 100.0 * one.other_probability,
                          NameOf(one.other_kind, one.other_index, design, data, *result, bar))
            : "",
        WordsOf(cause, bar));
    result->reasons.push_back(cause.text);
    rig_stands = rig_stands && (one.kind == CauseKind::kPoint || one.kind == CauseKind::kReading);
    result->causes.push_back(std::move(cause));
  }
  if (!result->explained) {
    result->reasons.push_back(
        bar ? "no camera or placement explains it: calibrate again"
            : "no single point or camera explains it: calibrate again (or the points were not "
              "measured in the frame in which the rig was surveyed)");
  } else if (rig_stands) {
    result->verdict = "doubtful";
    result->invalid = false;
  }
}

void NoteShown(CheckResult* result) {
  const auto less = [](const CheckedCamera& a, const CheckedCamera& b) {
    return a.shows_px < b.shows_px;
  };
  const auto most = std::max_element(result->cameras.begin(), result->cameras.end(), less);
  if (most == result->cameras.end()) return;
  if (!std::isfinite(most->shows_px)) {
    result->reasons.push_back(fmt::format(
        "this check cannot show that camera \"{}\" was shifted, or not tell it from another: give "
        "it more to see, and other places and directions",
        most->name));
    return;
  }
  const auto least = std::min_element(result->cameras.begin(), result->cameras.end(), less);
  result->reasons.push_back(fmt::format(
      "this check shows and names a camera that was shifted by {:.2g} px (\"{}\") to {:.2g} px "
      "(\"{}\") or more, nine times in ten",
      least->shows_px, least->name, most->shows_px, most->name));
}

}  // namespace unfurl::calib
