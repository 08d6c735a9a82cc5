#include "measure/live.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/refuse_option.h"
#include "data/lab.h"
#include "measure/record_match.h"
#include "measure/trial_record.h"

namespace unfurl::measure {

namespace {

constexpr double kLiveHour = 3600.0;  // [s]

// What is not used while it goes on: what was written cannot be put right.
std::vector<Correction> LeftOutBy(std::span<const Fault> faults) {
  std::vector<Correction> out = CorrectionsOf(faults, false);
  std::erase_if(out, [](const Correction& one) { return !one.leave_out && one.camera >= 0; });
  return out;
}

// One line of a block; of a block of one it is not copied.
const data::TrialBlock& LineOf(const data::TrialBlock& block, std::size_t i,
                               data::TrialBlock* line) {
  if (block.size() == 1) return block;
  const auto width = static_cast<std::ptrdiff_t>(block.counts.size() / block.size());
  const auto from = static_cast<std::ptrdiff_t>(i) * width;
  line->t.assign(1, block.t[i]);
  line->slot.assign(1, block.slot[i]);
  line->counts.assign(block.counts.begin() + from, block.counts.begin() + from + width);
  return *line;
}

// Line i of a block to those that the beginning has.
void Append(const data::TrialBlock& block, std::size_t i, LiveBeginning* beginning) {
  data::TrialBlock& all = beginning->lines;
  const auto width = static_cast<std::ptrdiff_t>(block.counts.size() / block.size());
  const auto from = block.counts.begin() + static_cast<std::ptrdiff_t>(i) * width;
  all.t.push_back(block.t[i]);
  all.slot.push_back(block.slot[i]);
  all.counts.insert(all.counts.end(), from, from + width);
}

void Append(const data::TrialReadings& block, std::size_t i, LiveBeginning* beginning) {
  data::TrialReadings& all = beginning->readings;
  all.path = block.path;
  all.cameras = block.cameras;
  all.pixels = block.pixels;
  all.slots = block.slots;
  all.most = block.most;
  all.t.push_back(block.t[i]);
  all.slot.push_back(block.slot[i]);
  for (std::size_t c = 0; c < block.cameras.size(); ++c) {
    const auto u = block.Readings(i, c), s = block.Sigmas(i, c);
    all.u_px.insert(all.u_px.end(), u.begin(), u.end());
    all.s_px.insert(all.s_px.end(), s.begin(), s.end());
  }
}

void ProcessLine(const data::TrialBlock& block, std::size_t i, data::TrialBlock* line,
                 Reconstructor* pass, data::Tracks* tracks) {
  pass->Process(LineOf(block, i, line), tracks);
}

void ProcessLine(const data::TrialReadings& block, std::size_t i, data::TrialBlock*,
                 Reconstructor* pass, data::Tracks* tracks) {
  pass->Process(block, i, 1, tracks);
}

void CheckBlock(const Reconstructor&, const data::TrialBlock&) {}  // its reader did
void CheckBlock(const Reconstructor& pass, const data::TrialReadings& block) {
  pass.CheckReadings(block);
}

// The same camera is meant, whatever kind of fault it is called while more of it is seen.
bool SameFault(const LiveNotice& a, const LiveNotice& b) {
  return a.kind == b.kind && a.camera == b.camera;
}

}  // namespace

void LiveOptions::Check() const {
  reconstruct.Check();
  watch.Check();
  const RefuseOption refuse("LiveOptions");
  if (!(look_every > 0.0)) refuse("look_every", "is not above 0", "give seconds");
  if (!(views_every > 0.0)) refuse("views_every", "is not above 0", "give seconds");
  if (look_lines == 0) refuse("look_lines", "is 0", "give lines");
}

Live::Live(data::LiveHeader header, std::string path, const data::Rig& rig, std::string rig_path,
           const LiveOptions& options, const TrialRecord* like, LiveListener* listener)
    : header_(std::move(header)),
      path_(std::move(path)),
      rig_(rig),
      rig_path_(std::move(rig_path)),
      options_(options),
      listener_(listener) {
  options.Check();
  beginning_.path = path_;
  beginning_.like = like;
  beginning_.evidence_lines = options.look_lines;
  if (!header_.readings) beginning_.header = header_.trial;
  MatchStream(header_, path_, rig_, rig_path_, like);
}

Live::~Live() {
  if (look_.valid()) look_.wait();
}

// Whole stretches, as they are looked at of a record that is there.
bool Live::CanBegin() const {
  const std::size_t waiting = beginning_.lines.size() + beginning_.readings.size();
  if (waiting == 0 || waiting % LiveBeginning::kLines != 0) return false;
  const std::vector<std::int32_t>& slots = beginning_.lines.slot;
  return header_.readings || std::any_of(slots.begin(), slots.end(), [&](std::int32_t slot) {
           return header_.trial.slots[static_cast<std::size_t>(slot)] == data::kDarkSlot;
         });
}

void Live::Begin() {
  pass_ = std::make_unique<Reconstructor>(beginning_, rig_, rig_path_, options_.reconstruct);
  const data::Tracks& layout = pass_->layout();
  RequireMarks(options_.reconstruct.health.distances, layout.marks, path_);
  for (const std::string& slot : header_.trial.slots) {
    marks_.emplace_back();
    for (const std::string& mark : data::MarksOfSlot(slot)) {
      marks_.back().push_back(layout.FindMark(mark));
    }
  }
  const double rate = pass_->line_rate();
  watch_.emplace(pass_->triangulator(), layout.marks, rate, options_.watch);
  every_ = std::max<std::size_t>(1, static_cast<std::size_t>(options_.look_every * rate));
  health_ = options_.reconstruct.health;
  health_.light = false;  // half a minute of what moves tells little of what fades
  // Looks overlap; that each of an hour may be wrong by itself is the careful case.
  health_.false_alarm = options_.watch.false_alarm * std::min(1.0, options_.look_every / kLiveHour);
  health_.scatter_alarm = health_.false_alarm;
  next_views_ = (header_.readings ? beginning_.readings.t : beginning_.lines.t).front() +
                options_.views_every;
  listener_->Begun(*pass_);
  const LiveBeginning begun = std::move(beginning_);
  beginning_ = {};
  if (header_.readings) {
    Process(begun.readings, 0, begun.readings.size());
  } else {
    Process(begun.lines, 0, begun.lines.size());
  }
}

template <typename Block>
void Live::Take(const Block& block) {
  for (std::size_t i = 0; i < block.size(); ++i) {
    if (pass_ != nullptr) {
      Process(block, i, i + 1);
      continue;
    }
    Append(block, i, &beginning_);
    if (CanBegin()) {
      Begin();
      CheckBlock(*pass_, block);
    } else if (beginning_.lines.size() >= kMostWaiting) {
      throw Error(fmt::format("none of the first {} lines is dark", kMostWaiting), path_,
                  "strobe a dark line in each round: the background is taken from it");
    }
  }
}

void Live::Add(const data::TrialBlock& lines) { Take(lines); }

void Live::Add(const data::TrialReadings& flashes) {
  if (pass_ != nullptr) CheckBlock(*pass_, flashes);
  Take(flashes);
}

// Line by line, so that nothing depends on how they come.
template <typename Block>
void Live::Process(const Block& block, std::size_t first, std::size_t end) {
  for (std::size_t i = first; i < end; ++i) {
    t_ = block.t[i];
    ProcessLine(block, i, &line_, pass_.get(), &tracks_);
    watch_->Samples(tracks_);
    if (tracks_.size() > 0) listener_->Samples(tracks_);
    Observe(block.slot[i]);
    if (++lines_ % every_ != 0) continue;
    TakeLook();
    Look();
  }
}

void Live::Observe(std::int32_t slot) {
  const HealthEvidence& evidence = pass_->evidence();
  notices_.clear();
  watch_->Line(t_, marks_[static_cast<std::size_t>(slot)],
               {&evidence.At(evidence.size() - 1, 0), pass_->layout().cameras.size()}, &notices_);
  for (const LiveNotice& notice : notices_) listener_->Notice(notice);
  if (t_ < next_views_) return;
  listener_->Views(t_, watch_->TakeViews());
  next_views_ = t_ + options_.views_every;
}

void Live::Look() {
  look_t_ = t_;
  look_ = std::async(std::launch::async, [evidence = pass_->evidence(), pass = pass_.get(),
                                          health = health_]() mutable {
    HealthReport report = Diagnose(evidence, pass->triangulator(), health, pass->layout().marks);
    const std::vector<Correction> corrections = CorrectionsOf(report.faults, false);
    for (const Correction& correction : corrections) evidence.Correct(correction);
    FindMisfit(evidence, pass->triangulator(), corrections, health, &report);
    return report;
  });
}

void Live::TakeLook() {
  if (!look_.valid()) return;
  const HealthReport report = look_.get();
  const std::vector<std::string>& cameras = pass_->layout().cameras;
  std::vector<Correction> away = LeftOutBy(report.faults);
  AddWidenings(report.scatter, report.misfit, cameras.size(), &away);
  pass_->LeaveOut(std::move(away));
  std::vector<LiveNotice> now;
  for (const Fault& fault : report.faults) {
    now.push_back({NoticeKind::kMoved, true, fault.certain() ? fault.camera : -1, -1, t_,
                   std::max(fault.earliest, 0.0), Describe(fault, cameras)});
  }
  if (report.scatter.wide || report.misfit.wide) {
    const std::vector<std::string>& marks = pass_->layout().marks;
    const std::string misfit = Describe(report.misfit);
    now.push_back({NoticeKind::kScatter, true, -1, -1, t_, std::max(t_ - options_.look_every, 0.0),
                   report.scatter.wide ? Describe(report.scatter, cameras, marks) : misfit});
    if (report.scatter.wide && !misfit.empty()) now.back().words += "; " + misfit;
  }
  const auto tell_new = [&](const std::vector<LiveNotice>& those,
                            const std::vector<LiveNotice>& others, bool begins) {
    for (LiveNotice notice : those) {
      const auto same = [&](const LiveNotice& other) { return SameFault(notice, other); };
      if (std::any_of(others.begin(), others.end(), same)) continue;
      notice.begins = begins;
      notice.t = t_;
      listener_->Notice(notice);
    }
  };
  tell_new(faults_, now, false);
  tell_new(now, faults_, true);
  faults_ = std::move(now);
  listener_->Looked(look_t_, report);
}

void Live::Finish(bool look) {
  if (pass_ == nullptr) {
    if (beginning_.lines.size() + beginning_.readings.size() == 0) {
      throw Error("holds no line", path_, "record some");
    }
    Begin();
  }
  pass_->Finish(&tracks_);
  watch_->Samples(tracks_);
  if (tracks_.size() > 0) listener_->Samples(tracks_);
  if (look) {
    TakeLook();
    Look();  // at the rest since the last one, and of a short record at all of it
    TakeLook();
  }
  listener_->Views(t_, watch_->TakeViews());
}

}  // namespace unfurl::measure
