#include "measure/live_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/refuse_option.h"

namespace unfurl::measure {

namespace {

constexpr double kLiveWatchNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kLiveWatchHour = 3600.0;  // [s]
// Of a spot's width: light of a Gaussian beyond is below a hundredth of a percent of its peak, and
// a spot that reaches the end of the row gives no reading.
constexpr double kReachWidths = 4.0;

}  // namespace

const char* Name(NoticeKind kind) {
  constexpr const char* kNames[] = {"no_light", "led",         "camera", "blocked", "aim",
                                    "left_out", "no_position", "moved",  "scatter"};
  return kNames[static_cast<std::size_t>(kind)];
}

void WatchOptions::Check() const {
  const RefuseOption refuse("WatchOptions");
  if (!(patience >= 0.0)) refuse("patience", "is negative", "give seconds");
  if (!(false_alarm > 0.0 && false_alarm < 1.0)) {
    refuse("false_alarm", "is not between 0 and 1", "give a chance");
  }
  if (!(miss > 0.0 && miss < 1.0)) refuse("miss", "is not between 0 and 1", "give a chance");
}

LiveWatch::LiveWatch(const Triangulator& triangulator, std::vector<std::string> marks,
                     double line_rate, const WatchOptions& options)
    : triangulator_(triangulator),
      marks_(std::move(marks)),
      options_(options),
      no_position_(marks_.size()),
      reason_(marks_.size(), data::SampleReason::kNone),
      place_(marks_.size(), Eigen::Vector3d::Constant(kLiveWatchNone)),
      place_t_(marks_.size(), -std::numeric_limits<double>::infinity()),
      last_(marks_.size(), kLiveWatchNone),
      gap_(marks_.size(), 0.0) {
  options.Check();
  const std::size_t cameras = triangulator.cameras();
  unseen_.resize(cameras * marks_.size());
  at_end_.resize(unseen_.size());
  left_out_.resize(unseen_.size());
  views_.resize(unseen_.size());
  for (LiveView& view : views_) view.u_px = kLiveWatchNone;
  // A run of misses may begin at any line of any camera.
  const double runs = kLiveWatchHour * line_rate * static_cast<double>(cameras);
  enough_ = std::max(1, static_cast<int>(std::ceil(std::log(options.false_alarm / runs) /
                                                   std::log(options.miss))));
}

// A run is told when it is long enough, and taken back by a run of the contrary.
void LiveWatch::Follow(double t, bool now, double wait, Run* run) const {
  if (now != run->now || run->count == 0) {
    run->now = now;
    run->count = 0;
    if (now && !run->told) run->since = t;
  }
  run->count = std::min(run->count + 1, enough_);
  if (run->count < enough_) return;
  if (!now) run->told = false;
  if (now && t - run->since >= wait) run->told = true;
}

void LiveWatch::Line(double t, std::span<const int> marks,
                     std::span<const HealthEvidence::Reading> readings,
                     std::vector<LiveNotice>* notices) {
  const std::size_t cameras = triangulator_.cameras();
  for (const int lit : marks) {
    const auto m = static_cast<std::size_t>(lit);
    if (t > last_[m]) gap_[m] = std::max(gap_[m], t - last_[m]);
    last_[m] = t;
    round_ = std::max(round_, gap_[m]);
    for (std::size_t c = 0; c < cameras; ++c) {
      const HealthEvidence::Reading& reading = readings[c];
      const bool seen = !std::isnan(reading.u_px);
      LiveView& view = views_[At(c, m)];
      ++view.lit;
      Follow(t, !seen, options_.patience, &unseen_[At(c, m)]);
      if (!seen) continue;
      ++view.seen;
      const double reach = kReachWidths * reading.width_px;
      const double end = triangulator_.rig().cameras[c].pixels - 1.0;
      const bool at_end = reading.u_px < reach || reading.u_px > end - reach;
      // Where several are lit together nobody knows yet whose reading it is.
      if (marks.size() > 1) continue;
      view.u_px = reading.u_px;
      view.width_px = reading.width_px;
      view.flux = reading.flux;
      Follow(t, at_end, options_.patience, &at_end_[At(c, m)]);
    }
  }
  if (marks.empty()) return;
  std::map<Key, LiveNotice> found = Judge(t);
  for (const auto& [key, notice] : found) {
    // What nobody sees has no position, and that is not news.
    if (key.kind == NoticeKind::kLed) no_position_[static_cast<std::size_t>(key.mark)] = {};
    if (key.kind == NoticeKind::kNoLight) no_position_.assign(marks_.size(), {});
  }
  for (auto& [key, notice] : standing_) {
    if (found.contains(key)) continue;
    notice.begins = false;
    notice.t = t;
    notices->push_back(notice);
  }
  for (auto& [key, notice] : found) {
    const auto before = standing_.find(key);
    if (before != standing_.end()) {
      notice = before->second;
    } else {
      notices->push_back(notice);
    }
  }
  standing_ = std::move(found);
}

void LiveWatch::Samples(const data::Tracks& tracks) {
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const auto m = static_cast<std::size_t>(tracks.mark[i]);
    const bool none = !data::Usable(tracks.status[i]);
    Follow(tracks.t[i], none, options_.patience, &no_position_[m]);
    if (none) {
      reason_[m] = tracks.reason[i];
      continue;
    }
    for (std::size_t c = 0; c < triangulator_.cameras(); ++c) {
      const bool used = (tracks.used[i] >> c & 1U) != 0;
      const bool left_out = !used && (tracks.left_out[i] >> c & 1U) != 0;
      // Without a reading nothing is known.
      if (used || left_out) Follow(tracks.t[i], left_out, options_.patience, &left_out_[At(c, m)]);
    }
    place_[m] = tracks.p.col(static_cast<Eigen::Index>(i));
    place_t_[m] = tracks.t[i];
  }
}

// Marks that no camera sees; -infinity where some camera does [s].
std::vector<double> LiveWatch::DarkSince(double t) const {
  constexpr double kSeen = -std::numeric_limits<double>::infinity();
  std::vector<double> since(marks_.size(), t);
  for (std::size_t m = 0; m < marks_.size(); ++m) {
    for (std::size_t c = 0; c < triangulator_.cameras(); ++c) {
      const Run& run = unseen_[At(c, m)];
      since[m] = run.told ? std::min(since[m], run.since) : kSeen;
      if (!run.told) break;
    }
  }
  return since;
}

std::map<LiveWatch::Key, LiveNotice> LiveWatch::Judge(double t) const {
  std::map<Key, LiveNotice> found;
  const auto add = [&](NoticeKind kind, int camera, int mark, double since, std::string words) {
    found[{kind, camera, mark}] = {kind, true, camera, mark, t, since, std::move(words)};
  };
  const std::vector<double> dark = DarkSince(t);
  std::vector<std::size_t> shown;  // marks that some camera sees
  double all_since = t;
  for (std::size_t m = 0; m < marks_.size(); ++m) {
    if (std::isnan(last_[m])) continue;  // never lit: nothing is known of it
    if (!std::isfinite(dark[m])) shown.push_back(m);
    all_since = std::min(all_since, std::isfinite(dark[m]) ? dark[m] : t);
  }
  if (shown.empty()) {
    add(NoticeKind::kNoLight, -1, -1, all_since, "no camera sees any mark");
    return found;
  }
  for (std::size_t m = 0; m < marks_.size(); ++m) {
    if (!std::isfinite(dark[m]) || std::isnan(last_[m])) continue;
    // Perhaps no camera sees any: the other marks' flashes come within a round.
    const bool known = standing_.contains({NoticeKind::kLed, -1, static_cast<int>(m)});
    if (!known && t - dark[m] < options_.patience + 2.0 * round_) continue;
    add(NoticeKind::kLed, -1, static_cast<int>(m), dark[m],
        fmt::format("no camera sees mark {}", marks_[m]));
  }
  // A mark that no camera sees says nothing of the cameras, nor a blind camera of the marks.
  for (std::size_t c = 0; c < triangulator_.cameras(); ++c) {
    double since = t;
    bool blind = true;
    for (const std::size_t m : shown) {
      blind = blind && unseen_[At(c, m)].told;
      since = std::min(since, unseen_[At(c, m)].since);
    }
    if (blind) {
      add(NoticeKind::kCamera, static_cast<int>(c), -1, since,
          fmt::format("camera {} sees no mark", triangulator_.rig().cameras[c].name));
      continue;
    }
    for (const std::size_t m : shown) JudgeView(t, c, m, &found);
    JudgeLeftOut(t, c, shown, &found);
  }
  for (const std::size_t m : shown) {
    if (!no_position_[m].told) continue;
    add(NoticeKind::kNoPosition, -1, static_cast<int>(m), no_position_[m].since,
        fmt::format("mark {} has no position: {}", marks_[m], data::Name(reason_[m])));
  }
  return found;
}

void LiveWatch::JudgeLeftOut(double t, std::size_t c, const std::vector<std::size_t>& shown,
                             std::map<Key, LiveNotice>* found) const {
  std::vector<std::size_t> now;
  double since = t;
  bool told = false;
  for (const std::size_t m : shown) {
    const Run& run = left_out_[At(c, m)];
    if (run.now) now.push_back(m);
    if (run.told) since = std::min(since, run.since);
    told = told || run.told;
  }
  if (!told) return;
  std::string words = fmt::format("camera {} contradicts the others{}: its readings are left out",
                                  triangulator_.rig().cameras[c].name,
                                  now.size() == 1 ? " on mark " + marks_[now[0]] : "");
  const int camera = static_cast<int>(c);
  (*found)[{NoticeKind::kLeftOut, camera, -1}] = {NoticeKind::kLeftOut, true, camera, -1, t, since,
                                                  std::move(words)};
}

void LiveWatch::JudgeView(double t, std::size_t c, std::size_t m,
                          std::map<Key, LiveNotice>* found) const {
  const Run &unseen = unseen_[At(c, m)], &at_end = at_end_[At(c, m)];
  const int camera = static_cast<int>(c), mark = static_cast<int>(m);
  NoticeKind kind = NoticeKind::kBlocked;
  if (unseen.told) {
    std::string words = WordsOfView(c, m, &kind);
    const Key blocked{NoticeKind::kBlocked, camera, mark}, aim{NoticeKind::kAim, camera, mark};
    // The cause that was told stays: where the mark goes on, unseen, does not change it.
    if (standing_.contains(aim)) kind = NoticeKind::kAim;
    if (standing_.contains(blocked)) kind = NoticeKind::kBlocked;
    // The other marks' flashes come within a round, and are told one later where times round:
    // perhaps the camera sees none of them.
    const double settled = options_.patience + 2.0 * round_;
    if (t - unseen.since < settled && !standing_.contains({kind, camera, mark})) return;
    (*found)[{kind, camera, mark}] = {kind, true, camera, mark, t, unseen.since, std::move(words)};
    return;
  }
  if (!at_end.told) return;
  kind = NoticeKind::kAim;
  (*found)[{kind, camera, mark}] = {
      kind,
      true,
      camera,
      mark,
      t,
      at_end.since,
      fmt::format("mark {} is at the end of camera {}'s row: it reads {:.1f} of 0 to {} px",
                  marks_[m], triangulator_.rig().cameras[c].name, views_[At(c, m)].u_px,
                  triangulator_.rig().cameras[c].pixels - 1)};
}

// Whether the mark is in the camera's field is known from where the others see it.
std::string LiveWatch::WordsOfView(std::size_t camera, std::size_t mark, NoticeKind* kind) const {
  const data::RigCamera& of = triangulator_.rig().cameras[camera];
  std::string words = fmt::format("camera {} does not see mark {}", of.name, marks_[mark]);
  if (std::isnan(place_[mark].x())) return words;
  std::vector<double> expected(triangulator_.bank().lanes(), kLiveWatchNone);
  triangulator_.bank().Readings(place_[mark].data(), expected.data());
  const double u = expected[camera];
  const bool fresh = place_t_[mark] >= unseen_[At(camera, mark)].since;
  const char* where = fresh ? "is" : "was last";
  if (u >= -0.5 && u <= of.pixels - 0.5) {
    return fmt::format("{}, which {} where it would read {:.0f} px", words, where, u);
  }
  *kind = NoticeKind::kAim;
  if (std::isnan(u)) return fmt::format("{}, which {} behind it", words, where);
  return fmt::format("{}, which {} beyond its row: at {:.0f} of 0 to {} px", words, where, u,
                     of.pixels - 1);
}

std::vector<LiveView> LiveWatch::TakeViews() {
  std::vector<LiveView> out = views_;
  for (LiveView& view : views_) view.lit = view.seen = 0;
  return out;
}

std::vector<LiveNotice> LiveWatch::Standing() const {
  std::vector<LiveNotice> out;
  for (const auto& [key, notice] : standing_) out.push_back(notice);
  return out;
}

}  // namespace unfurl::measure
