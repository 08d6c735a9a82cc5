#include "sim/record/run_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "base/count.h"
#include "base/fixed_number.h"
#include "base/table.h"
#include "sim/record/certificate_text.h"
#include "sim/record/record.h"

namespace unfurl::sim {

namespace {

using nlohmann::ordered_json;

constexpr std::size_t kMostJoints = 24;  // in a table on the terminal

double Peak(const std::vector<double>& values, std::size_t k) {
  return k < values.size() ? values[k] : 0.0;
}

std::string Margin(const TorqueMargin& margin) {
  if (!margin.seen()) return "-";
  return margin.resisted() ? fmt::format("{:.3g}", margin.ratio) : "unresisted";
}

ordered_json JointJson(const SummaryInput& in, std::size_t j) {
  const Model::Joint& joint = in.model.joints[j];
  ordered_json entry = {{"joint", joint.name},
                        {"peak_pin_force", Peak(in.report.peak_pin_force, j)},
                        {"peak_pin_time", Peak(in.report.peak_pin_time, j)}};
  if (in.report.PinForceUnknown(j)) {
    entry["peak_pin_force"] = nullptr;
    entry["pin_force_unknown"] = true;
  }
  if (joint.latch < 0) return entry;
  const LatchCount& count = in.recorder.latch(joint.latch);
  const auto k = static_cast<std::size_t>(joint.latch);
  entry["latched"] = count.latched ? ordered_json(count.latch_time) : ordered_json(nullptr);
  if (count.latched) entry["rate"] = count.latch_rate;
  entry["impacts"] = count.upper + count.lower;
  entry["upper"] = count.upper;
  entry["lower"] = count.lower;
  entry["ended"] = count.ended;
  if (count.ended > 0) entry["median_restitution"] = count.MedianRestitution();
  entry["peak_moment"] = Peak(in.report.peak_moment, k);
  entry["peak_time"] = Peak(in.report.peak_time, k);
  const TorqueMargin& margin = in.recorder.observables().margins().of(static_cast<int>(j));
  if (margin.seen()) {
    entry["least_driving_moment"] = margin.least_driving;
    entry["least_driving_theta"] = margin.least_theta;
  }
  if (margin.resisted()) {
    entry["torque_margin"] = margin.ratio;
    entry["torque_margin_theta"] = margin.ratio_theta;
  }
  return entry;
}

std::string EnergyText(const SummaryInput& in, ordered_json* json) {
  const Observables& o = in.recorder.observables();
  std::string text =
      fmt::format("energy at the end [J], of {:.6g} at the start\n", o.energy_at_start());
  const Balance& b = o.balance();
  std::vector<std::vector<std::string>> rows;
  const auto add = [&](const char* name, double value) {
    (*json)[name] = value;
    if (value != 0.0) rows.push_back({fmt::format("  {}", name), fmt::format("{:.7g}", value)});
  };
  add("kinetic", b.kinetic);
  add("bending", b.bending);
  add("axial", b.axial);
  for (std::size_t k = 0; k < kEffects; ++k) {
    if (kEffectTexts[k].energy != nullptr) add(kEffectTexts[k].energy, b.effects[k]);
  }
  add("dissipated_contact", b.dissipated_contact);
  add("dissipated_beams", b.dissipated_beams);
  add("dissipated_dampers", b.dissipated_dampers);
  add("work", b.work);
  (*json)["start"] = o.energy_at_start();
  (*json)["largest_residual"] = in.recorder.worst_residual();
  (*json)["moved"] = in.report.energy_moved;
  rows.push_back({"  largest residual", fmt::format("{:.2e}", in.recorder.worst_residual())});
  return text + AlignedTable(rows);
}

std::string ProfileText(const SimulateReport& report, ordered_json* json) {
  std::vector<std::vector<std::string>> rows = {{"part", "share [%]", "seconds"}};
  double inside = 0.0;
  const auto add = [&](const char* name, double seconds) {
    (*json)[name] = seconds;
    if (seconds == 0.0) return;
    rows.push_back({name, fmt::format("{:.1f}", 100.0 * seconds / report.seconds),
                    fmt::format("{:.3f}", seconds)});
  };
  for (int part = 0; part < Dynamics::kParts; ++part) {
    const double seconds = report.PartSeconds(part);
    add(Dynamics::PartName(part), seconds);
    inside += seconds;
  }
  add("steps, events, output", report.seconds - inside);
  return AlignedTable(rows);
}

}  // namespace

std::string PinForceText(const SimulateReport& report, std::size_t joint, const char* unit) {
  if (report.PinForceUnknown(joint)) return "not known";
  return fmt::format("{:.4g}{}", Peak(report.peak_pin_force, joint), unit);
}

bool PinForceLess(const SimulateReport& report, std::size_t a, std::size_t b) {
  if (report.PinForceUnknown(a) != report.PinForceUnknown(b)) return report.PinForceUnknown(b);
  return Peak(report.peak_pin_force, a) < Peak(report.peak_pin_force, b);
}

std::string EffectsText(const Model& model) {
  std::string text;
  for (const Model::EffectCount& effect : model.Effects()) {
    std::string name = effect.name;
    // What has no plural, gravity or a suspension, cannot be counted: 39 of it are bodies it acts
    // on.
    const bool counted = name.ends_with("s");
    if (effect.count == 1) {
      const std::string endings[][2] = {{"ies", "y"}, {"ches", "ch"}, {"s", ""}};
      for (const auto& [many, one] : endings) {
        if (!name.ends_with(many)) continue;
        name.replace(name.size() - many.size(), many.size(), one);
        break;
      }
    }
    text += (text.empty() ? "" : ", ") + (counted ? fmt::format("{} ", effect.count) : "") + name;
  }
  return text;
}

std::vector<std::string> ShownWarnings(const SummaryInput& in) {
  std::vector<std::string> all = in.model.warnings;
  all.insert(all.end(), in.report.warnings.begin(), in.report.warnings.end());
  constexpr std::size_t kMost = 6;  // warnings: of a hundred beams alike nobody reads each
  if (all.size() <= kMost) return all;
  const std::size_t more = all.size() - (kMost - 1);
  all.resize(kMost - 1);
  all.push_back(fmt::format("there are {} more warnings, which --json lists", more));
  return all;
}

std::string LatchSentence(const SummaryInput& in) {
  int closed = 0, all = 0;
  const Model::Joint* last = nullptr;
  std::vector<std::string> open;
  for (const Model::Joint& joint : in.model.joints) {
    if (joint.latch < 0) continue;
    ++all;
    const LatchCount& count = in.recorder.latch(joint.latch);
    if (!count.latched) {
      open.push_back(joint.name);
      continue;
    }
    ++closed;
    if (last == nullptr || count.latch_time > in.recorder.latch(last->latch).latch_time) {
      last = &joint;
    }
  }
  if (all == 0) return {};
  if (all == 1) {
    return closed == 0 ? fmt::format("the latch of {} did not close", open[0])
                       : fmt::format("the latch of {} closed at {:.6g} s", last->name,
                                     in.recorder.latch(last->latch).latch_time);
  }
  if (closed == 0) return fmt::format("none of the {} latches closed", all);
  const std::string when = fmt::format("the last, {}, at {:.6g} s", last->name,
                                       in.recorder.latch(last->latch).latch_time);
  if (closed == all) return fmt::format("all {} latches closed, {}", all, when);
  open.resize(std::min<std::size_t>(open.size(), 5));
  return fmt::format("{} of {} latches closed, {}; not: {}{}", closed, all, when,
                     fmt::join(open, ", "), all - closed > 5 ? ", ..." : "");
}

std::vector<std::vector<std::string>> JointTable(const SummaryInput& in, std::size_t most,
                                                 std::size_t* left_out) {
  const bool latches = in.model.latches.count() > 0;
  std::vector<std::vector<std::string>> rows = {{"joint", "peak pin force [N]", "at [s]"}};
  if (latches) {
    rows[0] = {"joint",         "latched [s]",         "rate [rad/s]",
               "torque margin", "least driving [N m]", "peak contact [N m]",
               "at [s]",        "peak pin force [N]",  "at [s]",
               "impacts",       "restitution"};
  }
  std::vector<std::size_t> order(in.model.joints.size());
  std::iota(order.begin(), order.end(), 0);
  *left_out = order.size() > most ? order.size() - most : 0;
  if (*left_out > 0) {
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return PinForceLess(in.report, b, a); });
    order.resize(most);
    std::sort(order.begin(), order.end());
  }
  for (const std::size_t j : order) {
    const Model::Joint& joint = in.model.joints[j];
    const std::string force = PinForceText(in.report, j, "");
    const std::string at = FixedNumber(Peak(in.report.peak_pin_time, j));
    if (!latches) {
      rows.push_back({joint.name, force, at});
      continue;
    }
    std::vector<std::string> row = {joint.name, "-", "-", "-", "-", "-", "-", force, at, "-", "-"};
    if (joint.latch >= 0) {
      const LatchCount& count = in.recorder.latch(joint.latch);
      const auto k = static_cast<std::size_t>(joint.latch);
      const TorqueMargin& margin = in.recorder.observables().margins().of(static_cast<int>(j));
      if (count.latched) {
        row[1] = FixedNumber(count.latch_time, 6);
        row[2] = FixedNumber(count.latch_rate, 3);
      }
      row[3] = Margin(margin);
      if (margin.seen()) row[4] = fmt::format("{:.4g}", margin.least_driving);
      row[5] = fmt::format("{:.4g}", Peak(in.report.peak_moment, k));
      row[6] = FixedNumber(Peak(in.report.peak_time, k));
      row[9] = fmt::format("{}", count.upper + count.lower);
      if (count.ended > 0) row[10] = fmt::format("{:.3f}", count.MedianRestitution());
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

// Of the beam whose lasting axial force counts most; null without beams of segments.
const AxialPeak* WorstPeak(const std::vector<AxialPeak>& peaks) {
  const AxialPeak* worst = nullptr;
  const auto lasting = [](const AxialPeak& p) { return std::max(p.tension, p.compression); };
  for (const AxialPeak& peak : peaks) {
    if (peak.euler == 0.0) continue;
    if (worst == nullptr || lasting(peak) > lasting(*worst)) worst = &peak;
  }
  return worst;
}

std::string LimitSentence(const SummaryInput& in) {
  std::vector<std::string> parts;
  if (in.report.steps == 0) return {};
  for (int k = 0; k < kStepLimits; ++k) {
    const long count = in.report.limited[static_cast<std::size_t>(k)];
    const double percent =
        100.0 * static_cast<double>(count) / static_cast<double>(in.report.steps);
    if (percent < 0.5) continue;
    std::string part = fmt::format("{} {:.0f} %", LimitName(static_cast<StepLimit>(k)), percent);
    const auto& worst = in.report.worst_bodies;
    const auto most = std::max_element(worst.begin(), worst.end());
    if (k == static_cast<int>(StepLimit::kError) && most != worst.end() && *most > 0) {
      part += fmt::format(" (mostly {})",
                          NameOfRigidBody(in.model, static_cast<int>(most - worst.begin())));
    }
    parts.push_back(part);
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

namespace {

std::string JointsText(const SummaryInput& in, ordered_json* json) {
  std::size_t left_out = 0;
  std::string text = AlignedTable(JointTable(in, kMostJoints, &left_out));
  if (left_out > 0) text += fmt::format("  and {} joints more, in the file\n", left_out);
  if (in.model.latches.count() > 0) {
    text +=
        "(torque margin: least driving over resisting moment before latching; restitution: "
        "median of -rate at the end / rate at the start)\n";
  }
  const bool struck = in.model.latches.count() > 0, bends = !in.model.beams.empty();
  if (in.certificate == nullptr && (struck || bends)) {
    text += fmt::format(
        "({}peak loads of {}{}{} may be off by far more than motions are: --certify states by how "
        "much)\n",
        struck ? "impacts hand errors on: motions after many may be off by hundreds of tolerances; "
               : "",
        struck ? "impacts" : "", struck && bends ? " and of " : "", bends ? "stiff parts" : "");
  }
  const auto& at = in.report.peak_pin_time;
  if (bends && in.report.steps > 0 && std::count(at.begin(), at.end(), 0.0) > 0) {
    text +=
        "(a pin force that is largest at 0 s is the mesh's: loads act at once on beams that they "
        "have not bent yet)\n";
  }
  for (std::size_t k = 0; k < in.model.joints.size(); ++k) {
    (*json)[in.model.joints[k].latch >= 0 ? "latches" : "joints"].push_back(JointJson(in, k));
  }
  return text;
}

std::string WarningsText(const SummaryInput& in, ordered_json* json) {
  std::string text;
  for (const std::string& warning : ShownWarnings(in)) text += "warning: " + warning + "\n";
  for (const auto* warnings : {&in.model.warnings, &in.report.warnings}) {
    for (const std::string& warning : *warnings) (*json)["warnings"].push_back(warning);
  }
  return text;
}

// What the longitudinal constraint leaves out of a segmented beam: P l^2 / EI of each.
std::string AxialText(const SummaryInput& in, ordered_json* json) {
  const std::vector<AxialPeak>& axial = in.report.axial;
  for (std::size_t b = 0; b < axial.size(); ++b) {
    const AxialPeak& peak = axial[b];
    if (in.model.beams[b].smooth >= 0) continue;
    (*json)["beams"].push_back({{"beam", in.model.beams[b].name},
                                {"largest_axial_ratio", peak.ratio},
                                {"largest_axial_ratio_time", peak.time},
                                {"lasting_tension_ratio", peak.tension},
                                {"lasting_compression_ratio", peak.compression},
                                {"lasting_compression", peak.pressed},
                                {"euler_load", peak.euler}});
  }
  const AxialPeak* peak = WorstPeak(axial);
  if (peak == nullptr) return "";
  return fmt::format(
      "axial forces beside bending, P l^2 / EI on segments of length l: {:.2g} at an instant, "
      "{:.2g} that lasts\n",
      peak->ratio, std::max(peak->tension, peak->compression));
}

}  // namespace

std::string SummaryText(const SummaryInput& in, ordered_json* json) {
  const SimulateReport& report = in.report;
  const bool whole = report.steps > 0;
  const double t_end = whole ? report.t_end : in.recorder.last_time();
  ordered_json& j = *json;
  j = {{"scene", in.scene}, {"run", in.out}, {"status", in.status}, {"t_end", t_end}};
  std::string text = fmt::format("{}: {:.9g} s of \"{}\"", in.scene, t_end, in.name);
  if (whole) text += fmt::format(" in {:.3g} s of computing", report.seconds);
  text += fmt::format(" -> {}\n", in.out);
  if (in.status != "good") {
    j["message"] = in.message;
    // It came to its end; what it says there is another matter.
    const bool judged = report.status == SimulateStatus::kEnergy ||
                        report.status == SimulateStatus::kDrift || in.status == kNotCertified;
    text += judged ? fmt::format("NOT USABLE: {}; the run stays in {}\n", in.message, in.out)
                   : fmt::format("NOT USABLE beyond {:.9g} s: {}; what there is stays in {}\n",
                                 t_end, in.message, in.out);
  }
  if (!report.stopped_by.empty()) {
    j["stopped_by"] = report.stopped_by;
    text += fmt::format("stopped by the event '{}'\n", report.stopped_by);
  }
  const std::string latches = LatchSentence(in);
  if (!latches.empty()) text += latches + "\n";
  if (!in.model.joints.empty() && whole) text += JointsText(in, json);
  text += EnergyText(in, &j["energy"]);
  text += fmt::format("constraints drifted by {:.1e} m and {:.1e} m/s at most\n",
                      report.largest_position_drift, report.largest_velocity_drift);
  j["largest_position_drift"] = report.largest_position_drift;
  j["largest_velocity_drift"] = report.largest_velocity_drift;
  if (report.near_dependence > 0) {
    j["near_dependence"] = report.near_dependence;
    text += fmt::format(
        "the constraints were nearly dependent (a dead centre, a flat chain) {}; "
        "the motion after such an instant may depend on rounding\n",
        report.near_dependence == 1 ? "once" : fmt::format("{} times", report.near_dependence));
  }
  text += WarningsText(in, json);
  if (in.certificate != nullptr) text += CertificateText(*in.certificate, report, json);
  text += AxialText(in, json);
  for (const Model::EffectCount& effect : in.model.Effects()) {
    j["effects"][effect.name] = effect.count;
  }
  text += "the scene calls for " + EffectsText(in.model) + "\n";
  text += fmt::format(
      "{}: {} ({} rejected), {}, {}, {}, {}\n", report.method, Counted(report.steps, "step"),
      report.rejected, Counted(report.evaluations, "evaluation"),
      Counted(report.projections, "projection"), Counted(in.recorder.samples(), "sample"),
      Counted(in.recorder.events(), "event"));
  text += fmt::format("steps limited by: {}\n", LimitSentence(in));
  j["method"] = report.method;
  j["steps"] = report.steps;
  j["rejected"] = report.rejected;
  j["evaluations"] = report.evaluations;
  j["projections"] = report.projections;
  j["samples"] = in.recorder.samples();
  j["events"] = in.recorder.events();
  j["seconds"] = report.seconds;
  for (int k = 0; k < kStepLimits; ++k) {
    j["limits"][LimitName(static_cast<StepLimit>(k))] = report.limited[static_cast<std::size_t>(k)];
  }
  if (in.profile) text += ProfileText(report, &j["profile"]);
  return text;
}

}  // namespace unfurl::sim
