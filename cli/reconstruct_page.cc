#include "cli/reconstruct_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/count.h"
#include "base/length.h"
#include "base/text.h"
#include "cli/reconstruct_health.h"
#include "cli/residual_views.h"
#include "cli/tracks_views.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using report::Chart;
using report::Series;
using report::Style;

constexpr double kMilli = 1e3;                // [mm/m]
constexpr double kReconstructPageBand = 2.0;  // sigmas of the error band

std::vector<double> ReconstructPageScaled(const std::vector<double>& x, double factor) {
  std::vector<double> out(x);
  for (double& v : out) v *= factor;
  return out;
}

double Share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

std::string CameraNames(std::uint32_t set, const std::vector<std::string>& cameras) {
  std::vector<std::string> names;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if ((set >> c & 1U) != 0) names.push_back(cameras[c]);
  }
  return JoinWords(names);
}

std::string StatusWords(data::SampleStatus status) {
  std::string words = data::Name(status);
  std::replace(words.begin(), words.end(), '_', ' ');
  return words;
}

void AddVerdict(const ReconstructPageInput& in, report::Page* page) {
  const measure::ReconstructSummary& s = *in.summary;
  const double usable = Share(s.usable(), s.samples());
  const bool rig_good = in.rig->verdict.empty() || in.rig->verdict == "good";
  report::Level level = usable >= 99.0 && rig_good ? report::Level::kGood
                        : usable >= 80.0           ? report::Level::kCare
                                                   : report::Level::kBad;
  std::vector<std::string> details = s.LostMarks();
  for (const std::vector<std::string>& dark : {s.DarkMarks(), s.LitDarkLines()}) {
    if (!dark.empty()) level = std::max(level, report::Level::kCare);
    details.insert(details.end(), dark.begin(), dark.end());
  }
  if (in.health != nullptr) level = std::max(level, AddVouching(*in.health, &details));
  if (in.health != nullptr && !in.health->words.empty()) {
    level = std::max(level, report::Level::kCare);
    details.insert(details.end(), in.health->words.begin(), in.health->words.end());
  }
  if (in.health != nullptr) {
    for (const data::TrialLight& change : in.health->light) {
      level = std::max(level, report::Level::kCare);
      details.push_back(change.words);
    }
  }
  const std::string exchanged = Describe(s.exchanged, s.marks);
  if (!exchanged.empty()) details.insert(details.begin(), exchanged);
  if (!s.LostMarks().empty() || !exchanged.empty()) level = report::Level::kBad;
  if (!rig_good) {
    details.push_back(fmt::format("The rig's own verdict is \"{}\".", in.rig->verdict));
  }
  for (const auto& [reason, count] : s.Unsolved()) {
    details.push_back(fmt::format("{} without a position: {}.",
                                  Counted(static_cast<std::size_t>(count), "sample"), reason));
  }
  for (std::size_t c = 0; c < s.left_out.size(); ++c) {
    if (s.left_out[c] == 0) continue;
    details.push_back(fmt::format(
        "{}: {} rejected, disagreeing with the other cameras or with the marks' motion, or because "
        "the camera had often been wrong before.",
        in.digest->cameras[c],
        Counted(static_cast<std::size_t>(s.left_out[c]), "reading") +
            (s.left_out[c] == 1 ? " was" : " were")));
  }
  if (!s.named_by_place.empty()) {
    details.push_back(
        fmt::format("{} are lit together and their starting positions were not given: they were "
                    "named in order of x.",
                    JoinWords(s.named_by_place)));
  }
  if (in.smoothing != nullptr) {
    details.push_back(
        "These tracks are smoothed: errors of neighbouring samples are correlated, and a fit "
        "refuses them.");
  }
  page->AddWords(
      level, fmt::format("{:.2f}% of {} have a position", usable, Counted(s.samples(), "sample")),
      details);
  std::size_t four = 0, three = 0, rejected = 0;
  for (const auto& counts : s.status) {
    four += counts[0];
    three += counts[1];
    rejected += counts[2];
  }
  const auto norm = [](const std::array<double, 3>& a) {
    return std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
  };
  page->AddFigures(
      {{"checked by a spare reading", fmt::format("{:.2f} %", Share(four, s.samples())), "",
        report::Level::kNeutral},
       {"from three cameras", fmt::format("{:.2f} %", Share(three, s.samples())),
        "no check but continuity", report::Level::kNeutral},
       {"a reading rejected", fmt::format("{:.2f} %", Share(rejected, s.samples())), "",
        report::Level::kNeutral},
       {"sigma by the readings", LengthText(norm(in.sigma_readings)), "of the distance, median",
        report::Level::kNeutral},
       {"sigma by the calibration", LengthText(norm(in.sigma_calibration)),
        fmt::format("common to all samples, {} directions", in.shared_rank),
        report::Level::kNeutral}});
}

void AddTracks(const ReconstructPageInput& in, report::Page* page) {
  page->AddSection(
      "The marks in time",
      fmt::format("In the rig's frame, with a band of ±{:.0f} standard deviations, the "
                  "calibration's part included. Drag to zoom; all charts of time "
                  "follow.",
                  kReconstructPageBand));
  const std::array<double, 3> origin = in.digest->FarOrigins();
  for (std::size_t m = 0; m < in.digest->marks.size(); ++m) {
    const TracksDigest::Dots& dots = in.digest->dots[m];
    Chart chart;
    chart.title = in.digest->marks[m] + ": where it is";
    chart.y = {"position", "m", false};
    for (std::size_t k = 0; k < 3; ++k) {
      chart.series.push_back({TracksAxisName(k, origin[k]), dots.t,
                              LessOrigin(dots.p[k], origin[k]),
                              ReconstructPageScaled(dots.axis[k], kReconstructPageBand),
                              Style::kDots, static_cast<int>(k)});
    }
    if (in.smoothing != nullptr) {
      for (double event : in.smoothing->events) chart.markers.push_back({event, "event", -1});
    }
    page->AddTimeSeries(std::move(chart));
  }
  Chart sigma;
  sigma.title = "What is known of each place";
  sigma.note = "One standard deviation of the distance, both parts together.";
  sigma.y = {"sigma", "mm", false};
  for (std::size_t m = 0; m < in.digest->marks.size(); ++m) {
    sigma.series.push_back({in.digest->marks[m],
                            in.digest->dots[m].t,
                            ReconstructPageScaled(in.digest->dots[m].sigma, kMilli),
                            {},
                            Style::kDots,
                            static_cast<int>(m)});
  }
  page->AddTimeSeries(std::move(sigma));
}

// Of a slice's samples [%]; NaN where there is none.
double ShareOf(const TracksDigest::Slice& slice, std::size_t status) {
  double all = 0.0;
  for (const auto count : slice.status) all += static_cast<double>(count);
  return 100.0 * static_cast<double>(slice.status[status]) / all;
}

void AddStatuses(const ReconstructPageInput& in, report::Page* page) {
  page->AddSection(
      "How each sample came about",
      "Shares of the samples in slices of time: four readings that agree; three, with nothing left "
      "over to check them; one of four rejected; no position.");
  const TracksDigest& d = *in.digest;
  for (std::size_t m = 0; m < d.marks.size(); ++m) {
    Chart chart;
    chart.title = d.marks[m] + ": samples by status";
    chart.y = {"share", "%", false};
    chart.height_px = 180;
    for (std::size_t k = 0; k < 4; ++k) {
      Series series;
      series.name = StatusWords(static_cast<data::SampleStatus>(k));
      series.style = Style::kLine;
      series.color = static_cast<int>(k);
      for (std::size_t i = 0; i < TracksDigest::kSlices; ++i) {
        series.x.push_back(d.start + (static_cast<double>(i) + 0.5) * d.slice);
        series.y.push_back(ShareOf(d.slices[m][i], k));
      }
      chart.series.push_back(std::move(series));
    }
    page->AddTimeSeries(std::move(chart));
  }
  report::Table table;
  table.title = "Why samples have no position";
  table.header = {"mark"};
  for (int r = 1; r < data::kSampleReasons; ++r) {
    table.header.emplace_back(data::Name(static_cast<data::SampleReason>(r)));
  }
  for (std::size_t m = 0; m < d.marks.size(); ++m) {
    table.rows.push_back({d.marks[m]});
    for (std::size_t r = 1; r < static_cast<std::size_t>(data::kSampleReasons); ++r) {
      table.rows.back().push_back(std::to_string(d.reasons[m][r]));
    }
  }
  page->AddTable(table);
  if (d.incidents.empty()) return;
  report::Table list;
  list.title = "What was rejected, and why";
  list.note = "The first sample of every run of equal ones.";
  if (d.more_incidents > 0) list.note += fmt::format(" {} more are not listed.", d.more_incidents);
  list.header = {"time [s]", "mark", "status", "why", "not taken"};
  list.text_columns = {1, 2, 3, 4};
  for (const TracksDigest::Incident& i : d.incidents) {
    std::string why = data::Name(i.reason);
    if (i.status == data::SampleStatus::kRejectedReading) {
      why = "the others meet in one point, and it is where the mark was going";
    }
    list.rows.push_back({fmt::format("{:.4f}", i.t), d.marks[static_cast<std::size_t>(i.mark)],
                         StatusWords(i.status), why, CameraNames(i.left_out, d.cameras)});
  }
  page->AddTable(list);
}

void AddResiduals(const ReconstructPageInput& in, report::Page* page) {
  const TracksDigest& d = *in.digest;
  page->AddSection("What the readings leave",
                   "Reading less what the point predicts, camera by camera. With four cameras one "
                   "number is left over per point, so the four move together; a trend in it is the "
                   "camera model's or the calibration's, a scatter the readings'.");
  Chart chart;
  chart.title = "Residuals by camera";
  chart.y = {"residual", "px", false};
  for (std::size_t c = 0; c < d.cameras.size(); ++c) {
    chart.series.push_back(
        {d.cameras[c], d.residual_t[c], d.residual[c], {}, Style::kDots, static_cast<int>(c)});
  }
  page->AddTimeSeries(std::move(chart));
  // The four share what one number shows, so each camera is judged by its own scatter.
  ResidualViews views;
  views.of = "camera";
  views.words = "over each camera's RMS";
  views.along = {"time", "s", false};
  views.scatter = false;
  views.own_scale = true;
  for (std::size_t c = 0; c < d.cameras.size() && d.cameras.size() > 3; ++c) {
    ResidualGroup group{d.cameras[c], d.residual_t[c], d.residual[c]};
    if (!DivideByRms(&group)) continue;
    // Three readings of each point go into its place.
    const double cameras = static_cast<double>(d.cameras.size());
    views.independent += static_cast<double>(group.value.size()) * (1.0 - 3.0 / cameras);
    views.groups.push_back(std::move(group));
  }
  AddResidualViews(views, page);
  report::Table table;
  table.title = "Cameras";
  table.header = {"camera",      "readings used", "not taken", "residual, RMS [px]", "saturated",
                  "at the edge", "overlapping",   "too dim",   "second spots"};
  for (std::size_t c = 0; c < d.cameras.size(); ++c) {
    const double rms =
        d.residual_count[c] == 0
            ? 0.0
            : std::sqrt(d.residual_squared[c] / static_cast<double>(d.residual_count[c]));
    const auto& flags = in.summary->flags[c];
    table.rows.push_back({d.cameras[c], std::to_string(in.summary->readings[c]),
                          std::to_string(in.summary->left_out[c]), fmt::format("{:.4f}", rms)});
    for (std::size_t bit = 0; bit < 5; ++bit) {
      table.rows.back().push_back(std::to_string(flags[bit]));
    }
  }
  page->AddTable(table);
}

void AddSmoothing(const ReconstructPageInput& in, report::Page* page) {
  if (in.smoothing == nullptr) return;
  report::Table table;
  table.title = "Smoothing, section by section";
  table.note =
      "The process noise (white jerk) is the likeliest one of each section; the innovations' "
      "chi-square per degree of freedom is 1 where model and noise fit.";
  table.header = {"mark", "from [s]", "to [s]", "samples", "jerk [m^2/s^5]", "chi-square"};
  for (const measure::SmoothSection& s : in.smoothing->sections) {
    table.rows.push_back({in.digest->marks[static_cast<std::size_t>(s.mark)],
                          fmt::format("{:.3f}", s.from), fmt::format("{:.3f}", s.to),
                          std::to_string(s.samples), fmt::format("{:.2g}", s.jerk),
                          fmt::format("{:.2f}", s.chi_square)});
  }
  page->AddTable(table);
}

}  // namespace

void WriteReconstructPage(const std::string& path, const ReconstructPageInput& input,
                          const data::Provenance& provenance) {
  report::Page page("Reconstruction", input.trial + " with " + input.rig_path);
  AddVerdict(input, &page);
  AddTracks(input, &page);
  AddTracksViews(*input.rig, *input.digest, &page);
  AddStatuses(input, &page);
  if (input.health != nullptr) AddHealth(*input.health, &page);
  AddResiduals(input, &page);
  AddSmoothing(input, &page);
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
