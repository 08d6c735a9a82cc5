#include "cli/live_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/count.h"
#include "cli/live.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

constexpr double kEvery = 1.0;           // [s] between two pages: what an eye follows
constexpr double kLivePageShown = 60.0;  // [s] of the marks' ways
constexpr double kDotEvery = 0.1;  // [s]: 600 dots of a mark, so that memory and page do not grow
constexpr std::size_t kLog = 40;   // notices that are kept: two screens of them

// Where a reading is in its row, as a bar of characters; no browser's script needed.
std::string LivePageBar(double u, int pixels) {
  constexpr int kCells = 30;  // characters: what a row of a table has room for
  std::string bar;
  const int at = static_cast<int>(std::floor((u + 0.5) / pixels * kCells));
  for (int k = 0; k < kCells; ++k) bar += k == at ? "\u25cf" : "\u00b7";
  return bar;
}

report::Level LevelOfLivePage(const measure::LiveNotice& notice) {
  using measure::NoticeKind;
  const bool view = notice.kind == NoticeKind::kBlocked || notice.kind == NoticeKind::kAim;
  return view ? report::Level::kCare : report::Level::kBad;
}

std::string Sentence(const measure::LiveNotice& notice) {
  return fmt::format("{} since {:.2f} s: {}", notice.words, notice.since, RemedyOf(notice));
}

void AddWords(const LivePageState& s, report::Page* page) {
  if (!s.why.empty()) {
    page->AddWords(report::Level::kBad, "It ended before the stream did: " + s.why);
  }
  if (!s.begun) {
    page->AddWords(report::Level::kNeutral, "Waiting for lines from " + s.source);
    return;
  }
  if (s.standing.empty()) {
    page->AddWords(report::Level::kGood,
                   fmt::format("Nothing is wrong at {:.2f} s: {} of {} seen{}", s.t,
                               Counted(s.marks.size(), "mark"), Counted(s.cameras.size(), "camera"),
                               s.ended ? "; the stream has ended" : ""));
    return;
  }
  std::vector<std::string> others;
  report::Level level = report::Level::kCare;
  for (const measure::LiveNotice& notice : s.standing) {
    if (LevelOfLivePage(notice) == report::Level::kBad) level = report::Level::kBad;
    if (&notice != &s.standing.front()) others.push_back(Sentence(notice));
  }
  page->AddWords(level, Sentence(s.standing.front()), others);
}

void AddFigures(const LivePageState& s, report::Page* page) {
  constexpr double kMs = 1e3;  // of a second
  const double share =
      s.samples > 0 ? 100.0 * static_cast<double>(s.usable) / static_cast<double>(s.samples) : 0.0;
  page->AddFigures({{"time of the record", fmt::format("{:.2f} s", s.t), Counted(s.lines, "line")},
                    {"samples with a position", fmt::format("{:.2f} %", share),
                     fmt::format("{} of {}", s.usable, s.samples)},
                    {"line to point, 99%", fmt::format("{:.2f} ms", kMs * s.latency_p99),
                     "from a line's arrival until what it decides is written"},
                    {"waited for later lines, 99%", fmt::format("{:.3f} s", s.waited_p99),
                     "of the record's time: samples in doubt"}});
}

void AddViews(const LivePageState& s, report::Page* page) {
  report::Table table;
  table.title = "Who sees what";
  table.note =
      "Of the last report: the flashes of each mark, and how many of them each camera saw; "
      "its last reading, and where that is in the camera's row.";
  table.header = {
      "camera", "mark", "seen", "reading [px]", "in its row", "width [px]", "brightness [count]"};
  table.text_columns = {0, 1, 4};
  for (std::size_t c = 0; c < s.cameras.size(); ++c) {
    for (std::size_t m = 0; m < s.marks.size(); ++m) {
      const std::size_t at = c * s.marks.size() + m;
      if (at >= s.views.size()) continue;
      const measure::LiveView& view = s.views[at];
      const bool read = std::isfinite(view.u_px);
      table.rows.push_back({s.cameras[c], s.marks[m], fmt::format("{} of {}", view.seen, view.lit),
                            read ? fmt::format("{:.2f}", view.u_px) : "",
                            read ? LivePageBar(view.u_px, s.pixels[c]) : "",
                            view.width_px > 0.0 ? fmt::format("{:.2f}", view.width_px) : "",
                            view.flux > 0.0 ? fmt::format("{:.0f}", view.flux) : ""});
    }
  }
  if (!table.rows.empty()) page->AddTable(table);
}

void AddWays(const LivePageState& s, report::Page* page) {
  constexpr const char* kAxes[] = {"x", "y", "z"};
  for (std::size_t k = 0; k < 3; ++k) {
    report::Chart chart;
    chart.title = fmt::format("The marks, {}", kAxes[k]);
    chart.note = k == 0 ? fmt::format("The last {:.0f} s, a dot every {} s; a gap has no position.",
                                      kLivePageShown, kDotEvery)
                        : "";
    chart.y = {kAxes[k], "m", false};
    for (std::size_t m = 0; m < s.marks.size(); ++m) {
      report::Series series;
      series.name = s.marks[m];
      series.style = report::Style::kDots;
      series.x.assign(s.ways[m].t.begin(), s.ways[m].t.end());
      series.y.assign(s.ways[m].p[k].begin(), s.ways[m].p[k].end());
      if (!series.x.empty()) chart.series.push_back(std::move(series));
    }
    if (!chart.series.empty()) page->AddTimeSeries(std::move(chart));
  }
}

void AddHealth(const LivePageState& s, report::Page* page) {
  if (!s.health_unknown.empty()) {
    page->AddSection("The cameras' health", "It cannot be told: " + s.health_unknown + ".");
    return;
  }
  if (s.health.empty()) return;
  report::Table table;
  table.title = "The cameras' health";
  table.note = "Each camera's readings against what the others predict, at the last look.";
  table.header = {"camera",         "offset [px]", "its sigma [px]",
                  "brightness [1]", "width [px]",  "at [s]"};
  const auto cell = [](double value, int digits) {
    return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : std::string();
  };
  for (std::size_t c = 0; c < s.health.size(); ++c) {
    const measure::HealthSlice& slice = s.health[c];
    table.rows.push_back({s.cameras[c], cell(slice.offset_px, 3), cell(slice.sigma_px, 3),
                          cell(slice.gain, 2), cell(slice.width_px, 2), cell(slice.t, 2)});
  }
  page->AddTable(table);
}

void AddLog(const LivePageState& s, report::Page* page) {
  if (s.log.empty()) return;
  report::Table table;
  table.title = "What was told";
  table.header = {"at [s]", "", "what"};
  table.text_columns = {1, 2};
  for (auto notice = s.log.rbegin(); notice != s.log.rend(); ++notice) {
    table.rows.push_back(
        {fmt::format("{:.2f}", notice->t), notice->begins ? "begins" : "is mended", notice->words});
  }
  page->AddTable(table);
}

}  // namespace

LivePage::LivePage(const LiveSettings& s, data::Provenance provenance)
    : path_(s.report), provenance_(std::move(provenance)) {
  state_.source = !s.trial.empty() ? s.trial : s.listen.empty() ? "standard input" : s.listen;
  Write(state_);  // now: where it cannot be written, nothing begins
}

LivePage::~LivePage() {
  if (writing_.valid()) writing_.wait();
}

void LivePage::Follow(const measure::Live* live, const Durations* latency,
                      const Durations* waited) {
  live_ = live;
  latency_ = latency;
  waited_ = waited;
}

void LivePage::Begun(const measure::Reconstructor& pass) {
  state_.begun = true;
  state_.cameras = pass.layout().cameras;
  state_.marks = pass.layout().marks;
  for (const data::RigCamera& camera : pass.triangulator().rig().cameras) {
    state_.pixels.push_back(camera.pixels);
  }
  state_.ways.resize(state_.marks.size());
  next_dot_.assign(state_.marks.size(), -std::numeric_limits<double>::infinity());
}

void LivePage::Samples(const data::Tracks& tracks) {
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const auto m = static_cast<std::size_t>(tracks.mark[i]);
    if (tracks.t[i] < next_dot_[m]) continue;
    next_dot_[m] = tracks.t[i] + kDotEvery;
    LivePageState::Way& way = state_.ways[m];
    way.t.push_back(tracks.t[i]);
    for (std::size_t k = 0; k < 3; ++k) {
      way.p[k].push_back(tracks.p(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(i)));
    }
    while (way.t.back() - way.t.front() > kLivePageShown) {
      way.t.pop_front();
      for (std::size_t k = 0; k < 3; ++k) way.p[k].pop_front();
    }
  }
}

void LivePage::Notice(const measure::LiveNotice& notice) {
  state_.log.push_back(notice);
  if (state_.log.size() > kLog) state_.log.erase(state_.log.begin());
  const auto same = [&](const measure::LiveNotice& other) {
    return other.kind == notice.kind && other.camera == notice.camera && other.mark == notice.mark;
  };
  std::erase_if(state_.standing, same);
  if (notice.begins) state_.standing.push_back(notice);
}

void LivePage::Looked(double, const measure::HealthReport& report) {
  state_.health_unknown = report.unknown;
  if (report.unvouched.any) state_.health_unknown = Describe(report.unvouched, state_.cameras);
  state_.health.clear();
  for (const auto& slices : report.cameras) {
    const auto last = std::find_if(slices.rbegin(), slices.rend(), [](const auto& slice) {
      return std::isfinite(slice.offset_px);
    });
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    state_.health.push_back(
        last == slices.rend() ? measure::HealthSlice{kNone, kNone, kNone, kNone, kNone} : *last);
  }
}

void LivePage::Views(double, std::span<const measure::LiveView> views) {
  state_.views.assign(views.begin(), views.end());
}

void LivePage::Refresh() {
  if (live_ == nullptr) return;
  state_.t = live_->t();
  state_.lines = live_->lines();
  state_.latency_p99 = latency_->Quantile(0.99);
  state_.waited_p99 = waited_->Quantile(0.99);
  if (const measure::Reconstructor* pass = live_->reconstructor()) {
    state_.samples = pass->summary().samples();
    state_.usable = pass->summary().usable();
  }
}

void LivePage::Update() {
  const auto now = std::chrono::steady_clock::now();
  if (std::chrono::duration<double>(now - last_).count() < kEvery) return;
  if (writing_.valid()) {
    if (writing_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
    writing_.get();
  }
  last_ = now;
  Refresh();
  writing_ = std::async(std::launch::async, [this, state = state_] { Write(state); });
}

void LivePage::Close(const std::string& why) {
  if (writing_.valid()) writing_.get();
  Refresh();
  state_.ended = true;
  state_.why = why;
  Write(state_);
}

void LivePage::Write(const LivePageState& state) const {
  report::Page page("Live", state.source);
  AddWords(state, &page);
  if (state.begun) {
    AddFigures(state, &page);
    AddViews(state, &page);
    AddWays(state, &page);
    AddHealth(state, &page);
    AddLog(state, &page);
  }
  page.AddOrigin(provenance_);
  if (!state.ended) {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    page.FollowEvery(kEvery, std::chrono::duration<double>(now).count());
  }
  page.Write(path_);
}

}  // namespace unfurl::cli
