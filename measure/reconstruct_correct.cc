// What is done about cameras that moved, drifted or are late, while a record is read.
#include "measure/reconstruct_correct.h"

#include <algorithm>
#include <cmath>

#include "measure/camera_model.h"
#include "measure/reconstruct.h"

namespace unfurl::measure {

namespace {

// Whether a line lies where the lines that a late camera's should be taken from were not recorded.
bool BeyondTheEnds(const Correction& correction, std::size_t line, std::size_t lines) {
  const auto from = static_cast<std::ptrdiff_t>(line) + correction.lag;
  return correction.lag != 0 && (from < 0 || from >= static_cast<std::ptrdiff_t>(lines));
}

std::span<const WrongReading> WrongOf(std::span<const WrongReading> wrong, std::size_t line) {
  const auto before = [](const WrongReading& one, const WrongReading& other) {
    return one.line < other.line;
  };
  const auto [from, to] =
      std::equal_range(wrong.begin(), wrong.end(), WrongReading{.line = line}, before);
  return {from, to};
}

bool AnyWidened(std::span<const Correction> corrections) {
  return std::any_of(corrections.begin(), corrections.end(),
                     [](const Correction& one) { return one.widen != 1.0; });
}

// Nobody knows yet whose spot it is where several marks are lit: the widest of theirs.
double WideningOf(std::span<const Correction> corrections, int camera, std::span<const int> lit) {
  double widest = 1.0;
  for (const int mark : lit) {
    double own = 1.0, any = 1.0;
    bool its = false;
    for (const Correction& correction : corrections) {
      if (correction.camera != camera || correction.widen == 1.0) continue;
      its = its || correction.mark == mark;
      (correction.mark == mark ? own : any) = correction.widen;
    }
    widest = std::max(widest, its ? own : any);
  }
  return widest;
}

}  // namespace

int CorrectionDirections(std::span<const Correction> corrections) {
  int directions = 0;
  for (const Correction& correction : corrections) {
    directions += (correction.sigma_px > 0.0) + (correction.slope_sigma > 0.0);
  }
  return directions;
}

void ReadLines(const data::TrialReader& trial, std::span<const Correction> corrections,
               std::size_t first, std::size_t count, data::TrialBlock* block) {
  trial.Read(first, count, block);
  const data::TrialHeader& header = trial.header();
  data::TrialBlock other;
  for (std::size_t c = 0; c < header.cameras.size(); ++c) {
    std::vector<std::ptrdiff_t> from(count);
    std::ptrdiff_t low = static_cast<std::ptrdiff_t>(trial.size()), high = -1;
    for (std::size_t i = 0; i < count; ++i) {
      std::ptrdiff_t at = static_cast<std::ptrdiff_t>(first + i);
      for (const Correction& correction : corrections) {
        const bool its = correction.camera == static_cast<int>(c);
        if (its && correction.Holds(block->t[i])) at += correction.lag;
      }
      const bool there = at >= 0 && at < static_cast<std::ptrdiff_t>(trial.size());
      from[i] = there && at != static_cast<std::ptrdiff_t>(first + i) ? at : -1;
      if (from[i] < 0) continue;
      low = std::min(low, at);
      high = std::max(high, at);
    }
    if (high < 0) continue;
    trial.Read(static_cast<std::size_t>(low), static_cast<std::size_t>(high - low + 1), &other);
    for (std::size_t i = 0; i < count; ++i) {
      if (from[i] < 0) continue;
      const auto line = other.Line(header, static_cast<std::size_t>(from[i] - low), c);
      std::copy(
          line.begin(), line.end(),
          block->counts.begin() + static_cast<std::ptrdiff_t>(i * header.line_counts() +
                                                              header.format.ElementsBefore(c)));
    }
  }
}

void Reconstructor::Correct(double t, std::size_t line, const Slot& slot, std::span<Seen> seen) {
  for (const Correction& correction : options_.corrections) {
    if (correction.camera < 0 || correction.leave_out || !correction.Holds(t)) continue;
    Seen& here = seen[static_cast<std::size_t>(correction.camera)];
    if (BeyondTheEnds(correction, line, last_line_)) here.count = 0;
    for (std::size_t k = 0; k < here.count; ++k) here.spots[k].u_px -= correction.Offset(t);
  }
  for (std::size_t c = 0; c < seen.size(); ++c) {  // with the stated sigmas: scatter is over them
    readings_[c] = {};
    if (seen[c].count == 0) continue;
    readings_[c] = {seen[c].spots[0].u_px, static_cast<float>(seen[c].spots[0].s_px), seen[c].flux,
                    seen[c].width_px};
  }
  // With an LED that stays lit every other slot is one of two marks.
  const bool alone =
      slot.marks.size() == 1 && (!lit_dark_ || slot.marks[0] == summary_.lit_dark.mark());
  evidence_.Add(t, alone ? slot.marks[0] : -1, readings_);
  for (const Correction& correction : options_.corrections) {
    if (correction.camera < 0 || !correction.Holds(t)) continue;
    Seen& here = seen[static_cast<std::size_t>(correction.camera)];
    if (correction.leave_out) here.count = 0;
  }
  for (const WrongReading& one : WrongOf(options_.wrong, line)) {
    seen[static_cast<std::size_t>(one.camera)].count = 0;
  }
  for (std::size_t c = 0; c < seen.size(); ++c) {
    const double widen = WideningOf(options_.corrections, static_cast<int>(c), slot.marks);
    for (std::size_t k = 0; k < seen[c].count; ++k) seen[c].spots[k].s_px *= widen;
  }
}

bool Reconstructor::Doubtful(double t) const {
  return std::any_of(options_.corrections.begin(), options_.corrections.end(),
                     [t](const Correction& c) { return c.camera < 0 && c.Holds(t); });
}

void Reconstructor::AddCorrectionErrors(const TrackedLine& line, const TrackedPoint& mine,
                                        Eigen::Ref<Eigen::Matrix3Xd> F) const {
  Eigen::Index column = 0;
  for (const Correction& correction : options_.corrections) {
    if (!(correction.sigma_px > 0.0) && !(correction.slope_sigma > 0.0)) continue;
    const auto c = static_cast<std::size_t>(correction.camera);
    Eigen::Vector3d lever = Eigen::Vector3d::Zero();
    Projection seen;
    if ((mine.point.cameras >> c & 1U) != 0 && correction.Holds(line.t) &&
        Project(triangulator_.rig().cameras[c], mine.point.p, &seen)) {
      const double floor = data::FloorOf(triangulator_.rig(), c);
      const double weight = 1.0 / (mine.s_px[c] * mine.s_px[c] + floor * floor);
      lever = weight * (mine.point.cov * seen.du_dp.transpose());
    }
    if (correction.sigma_px > 0.0) F.col(column++) = correction.sigma_px * lever;
    if (correction.slope_sigma > 0.0) {
      F.col(column++) = correction.slope_sigma * (line.t - correction.at) * lever;
    }
  }
}

namespace {

// The charts show what was there, not what is left.
void PutBackOffsets(const std::vector<Correction>& corrections, HealthReport* report) {
  for (const Correction& correction : corrections) {
    if (correction.camera < 0 || correction.leave_out) continue;
    for (HealthSlice& slice : report->cameras[static_cast<std::size_t>(correction.camera)]) {
      if (correction.Holds(slice.t)) slice.offset_px += correction.Offset(slice.t);
    }
  }
}

}  // namespace

bool HealthLoop::Again(const Reconstructor& pass, ReconstructOptions* options) {
  // Passes: a late camera, what hid behind it, wider sigmas twice, and one to see that.
  constexpr int kMost = 6;
  HealthReport now =
      Diagnose(pass.evidence(), pass.triangulator(), options->health, pass.layout().marks);
  PutBackOffsets(options->corrections, &now);
  // What cannot be told from another camera's fault is still there, and still cannot be told.
  const bool known = std::any_of(report_.faults.begin(), report_.faults.end(),
                                 [](const Fault& fault) { return !fault.certain(); });
  const std::vector<Fault> found = known ? std::vector<Fault>() : now.faults;
  now.faults = report_.faults;
  now.faults.insert(now.faults.end(), found.begin(), found.end());
  report_ = std::move(now);
  if (found.empty()) {
    FindMisfit(pass.evidence(), pass.triangulator(), options->corrections, options->health,
               &report_);
  }
  // Sigmas are widened by what scatters once nothing else is wrong; once, for the evidence keeps
  // those that were stated.
  const bool widened = AnyWidened(options->corrections);
  const bool wide = found.empty() && report_.scatter.wide && !widened;
  // Then by what the cameras leave over, which is told by what their noise is.
  const bool misfit = found.empty() && report_.misfit.wide && !misfit_;
  // Likewise readings that are wrong by themselves.
  const bool wrong = found.empty() && options->wrong.empty() && !report_.scatter.wrong.empty();
  if ((found.empty() && !wide && !misfit && !wrong) || ++passes_ == kMost) return false;
  if (wrong) options->wrong = report_.scatter.wrong;
  if (wide || misfit) {
    AddWidenings(report_.scatter, report_.misfit, pass.triangulator().cameras(),
                 &options->corrections);
  }
  misfit_ = misfit_ || misfit;
  for (const Correction& correction : CorrectionsOf(found, correct_)) {
    options->corrections.push_back(correction);
  }
  return true;
}

}  // namespace unfurl::measure
