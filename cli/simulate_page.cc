#include "cli/simulate_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/count.h"
#include "base/sentence.h"
#include "cli/certificate_panel.h"
#include "cli/motion_panel.h"
#include "cli/run_columns.h"
#include "report/page.h"
#include "sim/record/record.h"

namespace unfurl::cli {

namespace {

using report::Chart;
using report::Level;

constexpr std::size_t kMostCurves = 8;   // in one chart: the palette's colours
constexpr std::size_t kMostRows = 16;    // of the table of joints: half a screen
constexpr std::size_t kShapesShown = 9;  // instants, evenly spread: every eighth of the run
constexpr double kGoodResidual = 1e-4;   // of the energy's scale; beyond it the page says so

class Composer {
 public:
  Composer(const sim::SummaryInput& in, const data::Provenance& provenance)
      : in_(in), provenance_(provenance), run_(in.out), page_("Simulation", in.name) {}

  void Write(const std::string& path) {
    AddWords();
    AddFigures();
    AddJointTable();
    AddMotion();
    AddJoints();
    if (in_.certificate != nullptr) AddCertificate(in_, run_, &page_);
    AddEnergies();
    AddCost();
    page_.AddOrigin(provenance_);
    page_.Write(path);
  }

 private:
  bool Good() const { return in_.status == "good"; }

  double EnergyScale() const {
    const sim::Balance& b = in_.recorder.observables().balance();
    return std::max({std::fabs(in_.recorder.observables().energy_at_start()), b.kinetic,
                     std::fabs(b.Stored()), std::fabs(b.Dissipated())});
  }

  void AddWords() {
    std::vector<std::string> details;
    std::string headline = sim::LatchSentence(in_);
    bool all_closed = true;
    for (const sim::Model::Joint& joint : in_.model.joints) {
      if (joint.latch >= 0) all_closed = all_closed && in_.recorder.latch(joint.latch).latched;
    }
    if (headline.empty()) headline = fmt::format("{:.6g} s simulated", in_.report.t_end);
    headline = Capitalised(headline);
    Level level = all_closed ? Level::kGood : Level::kCare;
    if (!Good()) {
      headline = in_.status == sim::kNotCertified
                     ? std::string("Not certified")
                     : fmt::format("Not usable beyond {:.6g} s", in_.report.t_end);
      details.push_back(in_.message + ".");
      level = Level::kBad;
    }
    const double residual = in_.recorder.worst_residual(), scale = EnergyScale();
    if (scale > 0.0) {
      std::string words = fmt::format("The energy balance closes to {:.1e} J, {:.1e} of its scale.",
                                      residual, residual / scale);
      if (residual > kGoodResidual * scale) {
        words += " That is large: use a smaller --rtol.";
        level = std::max(level, Level::kCare);
      }
      details.push_back(words);
    }
    if (in_.certificate != nullptr) {
      const std::string words = CertificateSentence(in_);
      if (!words.empty()) details.push_back(words);
    }
    for (const std::string& warning : sim::ShownWarnings(in_)) {
      details.push_back("Warning: " + warning + ".");
      level = std::max(level, Level::kCare);
    }
    details.push_back("The scene calls for " + sim::EffectsText(in_.model) + ".");
    page_.AddWords(level, headline, details);
  }

  // The joints of the least torque margin and of the least driving moment.
  void AddMargins(std::vector<report::Figure>* figures) const {
    std::optional<std::size_t> margin, driving;
    const auto& joints = in_.model.joints;
    const sim::TorqueMargins& margins = in_.recorder.observables().margins();
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const sim::TorqueMargin& m = margins.of(static_cast<int>(j));
      if (m.resisted() && (!margin || m.ratio < margins.of(static_cast<int>(*margin)).ratio)) {
        margin = j;
      }
      if (m.seen() &&
          (!driving || m.least_driving < margins.of(static_cast<int>(*driving)).least_driving)) {
        driving = j;
      }
    }
    if (margin) {
      const sim::TorqueMargin& m = margins.of(static_cast<int>(*margin));
      figures->push_back({"least torque margin", fmt::format("{:.3g}", m.ratio),
                          fmt::format("{}, at {:.3g} rad", joints[*margin].name, m.ratio_theta),
                          m.ratio < 1.0 ? Level::kBad : Level::kNeutral});
    }
    if (driving) {
      const sim::TorqueMargin& m = margins.of(static_cast<int>(*driving));
      figures->push_back({"least driving moment", fmt::format("{:.4g} N m", m.least_driving),
                          fmt::format("{}, at {:.3g} rad", joints[*driving].name, m.least_theta),
                          Level::kNeutral});
    }
  }

  void AddFigures() {
    std::vector<report::Figure> figures;
    std::size_t moment = 0, force = 0;
    const auto& joints = in_.model.joints;
    const auto contact = [&](std::size_t j) {
      return joints[j].latch < 0
                 ? 0.0
                 : in_.report.peak_moment[static_cast<std::size_t>(joints[j].latch)];
    };
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (contact(j) > contact(moment)) moment = j;
      if (PinForceLess(in_.report, force, j)) force = j;
    }
    AddMargins(&figures);
    if (!joints.empty() && contact(moment) > 0.0) {
      const auto k = static_cast<std::size_t>(joints[moment].latch);
      figures.push_back(
          {"peak contact moment", fmt::format("{:.4g} N m", contact(moment)),
           fmt::format("{}, at {:.4g} s", joints[moment].name, in_.report.peak_time[k]),
           Level::kNeutral});
    }
    if (!joints.empty()) {
      figures.push_back(
          {"peak pin force", PinForceText(in_.report, force, " N"),
           fmt::format("{}, at {:.4g} s", joints[force].name, in_.report.peak_pin_time[force]),
           Level::kNeutral});
    }
    if (in_.model.latches.count() > 0) {
      figures.push_back({"impacts", fmt::format("{}", in_.recorder.impacts()),
                         "contacts that began", Level::kNeutral});
    }
    if (!figures.empty()) page_.AddFigures(figures);
  }

  void AddJointTable() {
    if (in_.model.joints.empty()) return;
    std::size_t left_out = 0;
    const auto rows = sim::JointTable(in_, kMostRows, &left_out);
    report::Table table;
    table.title = in_.model.latches.count() > 0 ? "Latches and loads" : "Loads";
    if (in_.model.latches.count() > 0) {
      table.note =
          "Torque margin: the least ratio of driving to resisting moment before the latch closed; "
          "friction counts in full. Restitution: the median of -rate at the end over rate at the "
          "start, of the impacts that ended.";
    }
    if (left_out > 0)
      table.note += fmt::format(" {} more {} in the file.", Counted(left_out, "joint"),
                                left_out == 1 ? "is" : "are");
    table.header = rows[0];
    table.rows.assign(rows.begin() + 1, rows.end());
    page_.AddTable(table);
  }

  std::vector<report::Marker> LatchMarkers() const {
    std::vector<report::Marker> markers;
    for (const sim::Model::Joint& joint : in_.model.joints) {
      if (joint.latch < 0 || !in_.recorder.latch(joint.latch).latched) continue;
      if (markers.size() == kMostCurves) break;
      markers.push_back({in_.recorder.latch(joint.latch).latch_time, joint.name + " latches", -1});
    }
    return markers;
  }

  // One chart of `part` of every name that has it; nothing where none has.
  void AddChart(const std::string& title, const std::string& note, const report::Axis& y,
                const std::vector<std::string>& names, const std::string& part, double factor) {
    Chart chart;
    chart.title = title;
    chart.note = note;
    chart.y = y;
    std::size_t have = 0;
    for (const std::string& name : names) {
      if (!run_.Has(name + part)) continue;
      if (++have > kMostCurves) continue;
      chart.series.push_back(run_.Read(name + part, name, factor));
    }
    if (have == 0) return;
    if (have > kMostCurves) chart.note += fmt::format(" {} of {}.", kMostCurves, have);
    chart.markers = LatchMarkers();
    page_.AddTimeSeries(std::move(chart));
  }

  template <typename List>
  static std::vector<std::string> Names(const List& list) {
    std::vector<std::string> names;
    names.reserve(list.size());
    for (const auto& item : list) names.push_back(item.name);
    return names;
  }

  void AddJoints() {
    const std::vector<std::string> joints = Names(in_.model.joints);
    if (joints.empty()) return;
    page_.AddSection("Joints", "Drag to zoom; all charts of time follow.");
    constexpr double kDegrees = 180.0 / M_PI;  // [deg/rad]
    AddChart("Angles", "0: deployed.", {"theta", "deg", false}, joints, ".theta", kDegrees);
    AddChart("Rates", "", {"rate", "rad/s", false}, joints, ".theta_rate", 1.0);
    AddChart("Contact moments", "Of the samples; the peaks between them are in the table.",
             {"moment", "N m", false}, joints, ".contact_moment", 1.0);
    AddChart("Spring moments", "", {"moment", "N m", false}, joints, ".spring_moment", 1.0);
    AddChart("Pin forces", "", {"force", "N", false}, joints, ".pin_force", 1.0);
  }

  void AddMotion() {
    page_.AddSection("Motion");
    const std::vector<std::string> marks = in_.recorder.observables().marks();
    if (auto motion = MotionOfRun(run_.reader(), marks)) page_.AddMotion(std::move(*motion));
    report::Paths paths;
    paths.title = "Paths of the marks";
    paths.note = "A ring at the start, a disc at the end.";
    paths.x = {"x", "m", false};
    paths.y = {"y", "m", false};
    if (marks.size() > kMostCurves)
      paths.note += fmt::format(" {} of {}.", kMostCurves, marks.size());
    for (const std::string& mark : marks) {
      if (paths.paths.size() == kMostCurves) break;
      report::Path path;
      path.name = mark;
      path.x = run_.Thin(mark + ".x");
      path.y = run_.Thin(mark + ".y");
      paths.paths.push_back(std::move(path));
    }
    if (!paths.paths.empty()) page_.AddPaths(paths);
    AddShapes();
    AddChart("Middle of the beams against the chord", "Positive to the left of the beam.",
             {"deflection", "mm", false}, Names(in_.model.beams), ".mid_deflection", 1e3);
    AddChart("Tip of the beams against the root's tangent", "Positive to the left of the beam.",
             {"deflection", "mm", false}, Names(in_.model.beams), ".tip_deflection", 1e3);
  }

  void AddShapes() {
    const std::vector<double>& t = run_.reader().shape_times();
    if (t.empty() || in_.model.beams.empty()) return;
    std::vector<double> xy;
    report::Paths paths;
    paths.title = "The beams in time";
    paths.x = {"x", "m", false};
    paths.y = {"y", "m", false};
    const std::size_t shown = std::min(kShapesShown, t.size());
    for (std::size_t k = 0; k < shown; ++k) {
      const std::size_t i = shown > 1 ? k * (t.size() - 1) / (shown - 1) : 0;
      report::Path path;
      path.name = fmt::format("{:.3g} s", t[i]);
      path.ends = false;
      path.color = static_cast<int>(k % kMostCurves);
      path.style = k < kMostCurves ? report::Style::kLine : report::Style::kDashes;
      run_.reader().ReadShapes(i, 1, &xy);
      std::size_t place = 0;
      for (const data::BeamShape& shape : run_.reader().shapes()) {
        if (shape.kind != data::ShapeKind::kBeam) break;  // beams come first
        for (std::size_t p = 0; p < shape.at.size(); ++p, place += 2) {
          path.x.push_back(xy[place]);
          path.y.push_back(xy[place + 1]);
        }
        path.x.push_back(std::nan(""));
        path.y.push_back(std::nan(""));
      }
      paths.paths.push_back(std::move(path));
    }
    page_.AddPaths(paths);
  }

  void AddEnergies() {
    page_.AddSection("Energy and what can be trusted");
    Chart chart;
    chart.title = "Energies";
    chart.y = {"energy", "J", false};
    for (const data::Quantity& q : in_.recorder.observables().quantities()) {
      if (!q.name.starts_with("energy.") || q.name == "energy.residual") continue;
      report::Series series = run_.Read(q.name, q.name.substr(7), 1.0);
      if (std::all_of(series.y.begin(), series.y.end(), [](double v) { return v == 0.0; })) {
        continue;
      }
      if (chart.series.size() == kMostCurves) series.style = report::Style::kDashes;
      chart.series.push_back(std::move(series));
    }
    chart.markers = LatchMarkers();
    if (!chart.series.empty()) page_.AddTimeSeries(std::move(chart));
    AddChart("What the integration lost or invented",
             "Stored and dissipated energy, less the work done and the energy at the start.",
             {"energy", "\u00b5J", false}, {"energy"}, ".residual", 1e6);
    AddChart("Drift of the constraints", "Largest violation.", {"distance", "nm", false},
             {"constraint"}, ".position", 1e9);
  }

  void AddCost() {
    const sim::SimulateReport& r = in_.report;
    page_.AddSection("What it cost",
                     fmt::format("{}. Steps limited by: {}.", r.method, sim::LimitSentence(in_)));
    report::Table table;
    table.title = "Work";
    table.header = {"", ""};
    const auto add = [&](const char* name, const std::string& value) {
      table.rows.push_back({name, value});
    };
    add("computing [s]", fmt::format("{:.3g}", r.seconds));
    add("simulated [s]", fmt::format("{:.6g}", r.t_end));
    add("steps", fmt::format("{}", r.steps));
    add("rejected", fmt::format("{}", r.rejected));
    add("evaluations of the right side", fmt::format("{}", r.evaluations));
    add("times that drift was removed", fmt::format("{}", r.projections));
    add("events", fmt::format("{}", in_.recorder.events()));
    if (in_.profile) {
      for (int part = 0; part < sim::Dynamics::kParts; ++part) {
        const double seconds = r.PartSeconds(part);
        if (seconds > 0.0) {
          table.rows.push_back({fmt::format("{} [s]", sim::Dynamics::PartName(part)),
                                fmt::format("{:.3g}", seconds)});
        }
      }
    }
    page_.AddTable(table);
  }

  const sim::SummaryInput& in_;
  const data::Provenance& provenance_;
  RunColumns run_;
  report::Page page_;
};

}  // namespace

void WriteSimulatePage(const std::string& path, const sim::SummaryInput& input,
                       const data::Provenance& provenance) {
  Composer(input, provenance).Write(path);
}

}  // namespace unfurl::cli
