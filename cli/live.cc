// `unfurl reconstruct --live`: lines as they come to marks as they are decided.
#include "cli/live.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>

#include "base/conclusion.h"
#include "base/count.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/signals.h"
#include "cli/live_output.h"
#include "cli/live_page.h"
#include "cli/live_source.h"
#include "data/live_stream.h"
#include "data/rig.h"
#include "measure/trial_record.h"

namespace unfurl::cli {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kAtOnce = 64;  // lines taken apart at once: 1 MB of four usual cameras
constexpr int kWait = 100;           // [ms] between looks at the clock and at signals

double SecondsSince(Clock::time_point then) {
  return std::chrono::duration<double>(Clock::now() - then).count();
}

data::Provenance ProvenanceOf(const Common& common, const LiveSettings& s) {
  data::Provenance provenance = StartProvenance(common);
  for (const std::string* path : {&s.trial, &s.rig, &s.like}) {
    if (!path->empty()) provenance.AddInput(*path);
  }
  return provenance;
}

// Flashes [first, first + count).
data::TrialReadings PartOf(const data::TrialReadings& all, std::size_t first, std::size_t count) {
  data::TrialReadings part;
  part.path = all.path;
  part.cameras = all.cameras;
  part.pixels = all.pixels;
  part.slots = all.slots;
  part.most = all.most;
  const auto cut = [&](const auto& from, std::size_t width, auto* to) {
    const auto begin = from.begin() + static_cast<std::ptrdiff_t>(first * width);
    to->assign(begin, begin + static_cast<std::ptrdiff_t>(count * width));
  };
  cut(all.t, 1, &part.t);
  cut(all.slot, 1, &part.slot);
  cut(all.u_px, all.cameras.size() * all.most, &part.u_px);
  cut(all.s_px, all.cameras.size() * all.most, &part.s_px);
  return part;
}

// Each is told in turn.
class Tellers : public measure::LiveListener {
 public:
  void Add(measure::LiveListener* one) { all_.push_back(one); }
  void Begun(const measure::Reconstructor& pass) override {
    for (LiveListener* one : all_) one->Begun(pass);
  }
  void Samples(const data::Tracks& tracks) override {
    for (LiveListener* one : all_) one->Samples(tracks);
  }
  void Notice(const measure::LiveNotice& notice) override {
    for (LiveListener* one : all_) one->Notice(notice);
  }
  void Looked(double t, const measure::HealthReport& report) override {
    kept_ = report.distances.kept;
    for (LiveListener* one : all_) one->Looked(t, report);
  }
  void Views(double t, std::span<const measure::LiveView> views) override {
    for (LiveListener* one : all_) one->Views(t, views);
  }

  bool kept() const { return kept_; }  // distances of marks on one body, at the last look

 private:
  std::vector<measure::LiveListener*> all_;
  bool kept_ = true;
};

// One run: what comes in, what becomes of it, and where it goes.
class LiveRun {
 public:
  LiveRun(const Common& common, const LiveSettings& s)
      : settings_(s), rig_(data::ReadRig(s.rig)), out_(!common.quiet), json_(&out_, &told_) {
    if (s.camera_shift > 0.0) measure::AllowForShifts(s.camera_shift, &rig_);
    if (!s.like.empty()) like_.emplace(s.like);
    if (!s.report.empty()) page_.emplace(s, ProvenanceOf(common, s));
  }

  int Follow() {
    std::string why;
    std::optional<Error> error;
    bool interrupted = false;
    try {
      if (settings_.trial.empty()) {
        FollowStream();
      } else {
        FollowRecord();
      }
    } catch (const Interrupted&) {
      interrupted = true;
      why = "interrupted";
    } catch (const Error& wrong) {
      error = wrong;
      why = wrong.what();
    }
    Conclude(why);
    if (error) throw *error;
    if (interrupted) {
      Complain(fmt::format("interrupted after {}; all samples that they give were written",
                           Counted(live_ ? live_->lines() : 0, "line")));
      return kExitInterrupted;
    }
    return Judge();
  }

 private:
  void Open(data::LiveHeader header, const std::string& where) {
    tellers_.Add(&json_);
    if (page_) tellers_.Add(&*page_);
    live_.emplace(std::move(header), where, rig_, settings_.rig, settings_.options,
                  like_ ? &*like_ : nullptr, &tellers_);
    told_ = &*live_;
    if (page_) page_->Follow(&*live_, &latency_, &json_.window());
  }

  // Lines that arrived together, all the way; the output is flushed.
  template <typename Block>
  void Pass(const Block& block, Clock::time_point arrived) {
    live_->Add(block);
    out_.Flush();
    latency_.Add(SecondsSince(arrived), block.size());
    if (page_) page_->Update();
  }

  void FollowStream() {
    std::optional<LiveSource> source;
    if (settings_.listen.empty()) {
      source.emplace();
    } else {
      source.emplace(settings_.listen);
      json_.Listening(source->where());
      out_.Flush();
    }
    data::LiveStreamReader reader(source->where());
    Clock::time_point last = Clock::now();
    while (!reader.ended()) {
      ThrowIfInterrupted();
      std::string_view bytes;
      const bool waiting = !source->connected();
      const LiveSource::Got got = source->Read(kWait, &bytes);
      const Clock::time_point arrived = Clock::now();
      if (waiting) last = arrived;
      if (got == LiveSource::Got::kEnd) reader.Close();
      const std::size_t before = reader.taken();
      if (got == LiveSource::Got::kBytes) TakeAll(bytes, arrived, &reader);
      if (reader.taken() > before) last = Clock::now();  // what we took for them is not its silence
      if (page_) page_->Update();
      if (settings_.timeout > 0.0 && SecondsSince(last) > settings_.timeout) {
        throw Error(fmt::format("no line came for {} s", settings_.timeout), reader.where(),
                    "see what became of the recorder, or wait longer with --timeout");
      }
    }
  }

  void TakeAll(std::string_view bytes, Clock::time_point arrived, data::LiveStreamReader* reader) {
    reader->Feed(bytes);
    if (reader->header() == nullptr) return;
    if (!live_) Open(*reader->header(), reader->where());
    if (reader->header()->readings) {
      while (reader->Take(kAtOnce, &flashes_) > 0) Pass(flashes_, arrived);
    } else {
      while (reader->Take(kAtOnce, &lines_) > 0) Pass(lines_, arrived);
    }
  }

  // A record that is there, as if its lines came now.
  void FollowRecord() {
    const measure::TrialRecord record(settings_.trial);
    Open(record.Header(), settings_.trial);
    for (std::size_t first = 0; first < record.size(); first += kAtOnce) {
      ThrowIfInterrupted();
      const std::size_t count = std::min(kAtOnce, record.size() - first);
      if (record.readings() != nullptr) {
        flashes_ = PartOf(*record.readings(), first, count);
        Pass(flashes_, Clock::now());
      } else {
        record.lines()->Read(first, count, &lines_);
        Pass(lines_, Clock::now());
      }
    }
  }

  // What was held back comes out, and the last word.
  void Conclude(const std::string& why) {
    const Conclusion conclusion;
    if (live_ && (live_->lines() > 0 || why.empty())) {
      live_->Finish(why.empty());
      json_.End(*live_, latency_, why);
    }
    out_.Flush();
    if (page_) page_->Close(why);
  }

  int Judge() const {
    const measure::ReconstructSummary& done = live_->reconstructor()->summary();
    const std::string where = settings_.trial.empty() ? "the stream" : settings_.trial;
    if (done.usable() == 0) return NotUsable(where, "no sample is usable");
    const std::string exchanged = Describe(done.exchanged, done.marks);
    if (!exchanged.empty()) return NotUsable(where, exchanged);
    if (!tellers_.kept()) {
      return NotUsable(where, "the marks of --rigid did not keep their distance at the last look");
    }
    const std::vector<std::string> lost = done.LostMarks();
    return lost.empty() ? kExitGood : NotUsable(where, lost.front());
  }

  const LiveSettings& settings_;
  data::Rig rig_;  // read once
  std::optional<measure::TrialRecord> like_;
  WholeLines out_;
  const measure::Live* told_ = nullptr;
  LiveJson json_;
  std::optional<LivePage> page_;
  Tellers tellers_;
  std::optional<measure::Live> live_;
  Durations latency_;  // from a line's arrival until all that it gives is written
  data::TrialBlock lines_;
  data::TrialReadings flashes_;
};

}  // namespace

void AddLiveOptions(Verb* verb, LiveSettings* s) {
  CLI::App* app = verb->app;
  app->add_flag("--live", s->live,
                "Follow lines as they come, on standard input or --listen, to JSON on standard "
                "output, one object a line, and a page that follows (docs/live.md)");
  app->add_option("--listen", s->listen,
                  "With --live: take the stream from one client of this port")
      ->type_name("HOST:PORT");
  verb->files->Read("--like", &s->like,
                    "With --live: a record of the same cameras and marks that shows how fast marks "
                    "are and where they go; default: the stream's beginning");
  app->add_option("--timeout", s->timeout,
                  "With --live: give up when no line came for so long [s]; 0: never")
      ->capture_default_str();
  app->add_option("--patience", s->options.watch.patience,
                  "With --live: what is wrong with a view is told when it lasts so long [s]")
      ->capture_default_str();
}

void RefuseWithLive(const GivenOptions& options) {
  for (const auto& [option, given] : options) {
    if (!given) continue;
    throw Error("needs the whole record, and --live follows one", option,
                "leave it out; reconstruct the recorded trial afterwards");
  }
}

void CheckNotLive(const LiveSettings& s) {
  const LiveSettings none;
  const GivenOptions mine = {
      {"--listen", !s.listen.empty()},
      {"--like", !s.like.empty()},
      {"--timeout", s.timeout != none.timeout},
      {"--patience", s.options.watch.patience != none.options.watch.patience}};
  for (const auto& [option, given] : mine) {
    if (given) throw Error("matters to --live only", option, "add --live, or leave it out");
  }
}

int RunLive(const Common& common, const LiveSettings& s) {
  if (!s.trial.empty() && !s.listen.empty()) {
    throw Error("a record does not come by a port", "--listen", "give the one or the other");
  }
  if (!std::isfinite(s.timeout) || s.timeout < 0.0) {
    throw Error("is no time to wait", "--timeout", "give seconds, or 0 to wait for ever");
  }
  if (!std::isfinite(s.options.watch.patience) || s.options.watch.patience < 0.0) {
    throw Error("is no time to wait", "--patience", "give seconds");
  }
  return LiveRun(common, s).Follow();
}

}  // namespace unfurl::cli
