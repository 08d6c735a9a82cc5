#include "correlate/compare/comparison_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace unfurl::correlate {

namespace {

using nlohmann::ordered_json;

// JSON has no NaN: what could not be computed is null.
ordered_json Value(double v) { return std::isfinite(v) ? ordered_json(v) : ordered_json(nullptr); }

ordered_json PeakJson(const std::vector<Peak>& peaks, int index) {
  if (index < 0) return nullptr;
  const Peak& p = peaks[static_cast<std::size_t>(index)];
  return {{"frequency", p.frequency}, {"amplitude", p.amplitude}};
}

ordered_json AlignmentJson(const Comparison& c) {
  const Alignment& a = c.alignment;
  ordered_json json;
  json["time_offset"] = {{"value", a.at.offset}, {"sigma", a.Sigma("time offset")}, {"unit", "s"}};
  if (a.drift != 0.0) {
    json["clock_drift"] = {{"value", a.drift},
                           {"sigma", a.Sigma("clock drift")},
                           {"unit", "1"},
                           {"pivot", a.drift_pivot}};
  }
  json["overlap"] = {a.overlap_start, a.overlap_end};
  json["r2"] = a.r2;
  json["chi2_per_dof"] = a.chi2_per_dof;
  if (c.marks.empty()) return json;  // channels have no frame
  ordered_json rotation, translation;
  for (Eigen::Index row = 0; row < 3; ++row) {
    rotation.push_back(
        {a.at.X_WM.linear()(row, 0), a.at.X_WM.linear()(row, 1), a.at.X_WM.linear()(row, 2)});
    translation.push_back(a.at.X_WM.translation()(row));
  }
  json["frame"] = {{"rotation", rotation}, {"translation", translation}};
  for (std::size_t i = 0; i < a.unknowns.size(); ++i) {
    if (a.unknowns[i].rfind("frame", 0) == 0) {
      json["frame"]["sigma"][a.unknowns[i]] = a.Sigma(a.unknowns[i]);
    }
  }
  return json;
}

ordered_json ScoreJson(const ComparedScore& s) {
  constexpr const char* kKinds[] = {"mark", "angle", "all", "channel"};  // by ComparedScore::Of
  ordered_json json = {{"name", s.name},
                       {"kind", kKinds[static_cast<std::size_t>(s.of)]},
                       {"unit", s.Unit()},
                       {"samples", s.score.samples},
                       {"rmse", s.score.rmse},
                       {"nrmse", Value(s.score.nrmse)},
                       {"r2", Value(s.score.r2)},
                       {"largest", s.score.largest},
                       {"largest_at", s.score.largest_at},
                       {"sigmas", s.sigmas},
                       {"sprague_geers",
                        {{"magnitude", Value(s.score.sprague_geers_magnitude)},
                         {"phase", Value(s.score.sprague_geers_phase)},
                         {"combined", Value(s.score.sprague_geers)}}},
                       {"russell",
                        {{"magnitude", Value(s.score.russell_magnitude)},
                         {"phase", Value(s.score.russell_phase)},
                         {"comprehensive", Value(s.score.russell)}}}};
  json["iso_18571"] = nullptr;
  if (s.rated) {
    json["iso_18571"] = {{"corridor", s.rating.corridor},   {"phase", s.rating.phase},
                         {"magnitude", s.rating.magnitude}, {"slope", s.rating.slope},
                         {"overall", s.rating.overall},     {"grade", Name(s.rating.grade)},
                         {"sample_interval", s.rating_step}};
  }
  return json;
}

ordered_json SpectrumJson(const ComparedSpectrum& s) {
  ordered_json peaks = ordered_json::array();
  for (const PeakPair& p : s.pairs) {
    peaks.push_back({{"measured", PeakJson(s.measured_peaks, p.a)},
                     {"reference", PeakJson(s.reference_peaks, p.b)}});
  }
  ordered_json json = {{"signal", s.name},
                       {"unit", s.id.Unit()},
                       {"convention", s.measured.convention},
                       {"resolution", s.measured.resolution},
                       {"frac", s.frac >= 0.0 ? ordered_json(s.frac) : ordered_json(nullptr)},
                       {"peaks_of", s.by_density ? "density" : "amplitude"},
                       {"peaks", peaks}};
  if (s.density.segments > 0 && s.density.yy.empty()) {
    json["density"] = {{"convention", s.density.convention},
                       {"frequency", s.density.frequency},
                       {"measured", s.density.xx}};
  } else if (s.density.segments > 0) {
    json["density"] = {
        {"convention", s.density.convention}, {"frequency", s.density.frequency},
        {"measured", s.density.xx},           {"reference", s.density.yy},
        {"coherence", s.density.coherence},   {"no_coherence", s.density.no_coherence}};
  }
  if (!s.note.empty()) json["note"] = s.note;
  return json;
}

// What an ambient record is worth, and each of its modes.
ordered_json AmbientJson(const AmbientFit& fit) {
  ordered_json lines = ordered_json::array(), modes = ordered_json::array();
  for (const SteadyLine& line : fit.lines) {
    lines.push_back({{"frequency", line.frequency}, {"chance", line.chance}});
  }
  for (const AmbientMode& m : fit.modes) {
    modes.push_back({{"harmonic", m.harmonic},
                     {"bandwidth_bins", m.bandwidth_bins},
                     {"shift", m.shift},
                     {"shift_sigma", m.shift_sigma},
                     {"steadiness", m.steadiness},
                     {"doubts", m.doubts}});
  }
  ordered_json left_out = ordered_json::array();
  for (const AmbientSwing& swing : fit.left_out) {
    left_out.push_back(
        {{"frequency", swing.frequency}, {"damping_ratio", swing.damping}, {"share", swing.share}});
  }
  return {{"duration", fit.duration},     {"band", {fit.low, fit.high}},
          {"stationary", fit.stationary}, {"strength_ratio", fit.strength_ratio},
          {"doubts", fit.doubts},         {"lines", lines},
          {"left_out", left_out},         {"modes", modes}};
}

ordered_json ModesJson(const ModalFit& fit, const std::string& vibration, bool doubtful,
                       const std::optional<AmbientFit>& ambient) {
  const DecayFit& d = fit.decay;
  ordered_json modes = ordered_json::array();
  for (const Mode& m : d.modes) {
    ordered_json real = ordered_json::array(), imaginary = ordered_json::array();
    ordered_json real_sigma = ordered_json::array(), imaginary_sigma = ordered_json::array();
    for (Eigen::Index j = 0; j < m.shape.size(); ++j) {
      real.push_back(m.shape(j).real());
      imaginary.push_back(m.shape(j).imag());
      real_sigma.push_back(m.shape_sigma(0, j));
      imaginary_sigma.push_back(m.shape_sigma(1, j));
    }
    modes.push_back({{"frequency", m.frequency},
                     {"frequency_sigma", m.frequency_sigma},
                     {"damping_ratio", m.damping},
                     {"damping_ratio_sigma", m.damping_sigma},
                     {"amplitude", m.amplitude.cwiseAbs().maxCoeff()},
                     {"share", m.share},
                     {"information", m.information},
                     {"stable_poles", m.members},
                     {"shape",
                      {{"real", real},
                       {"imaginary", imaginary},
                       {"real_sigma", real_sigma},
                       {"imaginary_sigma", imaginary_sigma}}}});
  }
  ordered_json json = {{"status", Name(d.status)},
                       {"message", d.message},
                       {"vibration", ambient ? "ambient" : "decay"},
                       {"why", vibration},
                       {"doubtful", doubtful},
                       {"explained", d.explained},
                       {"residual_rms", d.residual_rms},
                       {"chi2_per_dof", d.chi2_per_dof},
                       {"modes", modes}};
  if (ambient) json["ambient"] = AmbientJson(*ambient);
  return json;
}

}  // namespace

ordered_json ComparisonJson(const Comparison& c) {
  const bool alone = c.reference.empty();
  ordered_json json = {{"record", c.record},
                       {"reference", alone ? ordered_json(nullptr) : ordered_json(c.reference)},
                       {"status", Name(c.alignment.status)},
                       {"verdict", c.verdict},
                       {"reasons", c.reasons}};
  for (const Explanation& one : c.explanations) {
    ordered_json entry = {{"kind", Name(one.kind)}, {"left", one.left}};
    if (one.marks.empty()) {
      entry["value"] = one.value;
    } else {
      entry["marks"] = one.marks;
    }
    json["explanations"].push_back(std::move(entry));
  }
  if (!c.alignment.Usable()) return json;
  json["marks"] = c.marks;
  for (const ComparedChannel& one : c.channels) {
    json["channels"].push_back(
        {{"name", one.name},
         {"unit", one.unit},
         {"of", one.of.empty() ? ordered_json(nullptr) : ordered_json(one.of)}});
  }
  if (!alone) json.update(AlignmentJson(c));
  for (const MarkError& e : c.errors) {
    json["errors"].push_back({{"mark", e.mark},
                              {"samples", e.samples},
                              {"rmse", e.rmse},
                              {"rmse_in_plane", e.rmse_in_plane},
                              {"rmse_across", e.rmse_across},
                              {"bias_across", e.bias_across},
                              {"largest", e.largest},
                              {"largest_at", e.largest_at},
                              {"sigmas", e.sigmas}});
  }
  if (!alone) json["test"] = c.record_is_test ? "record" : "reference";
  for (const ComparedScore& s : c.scores) json["scores"].push_back(ScoreJson(s));
  json["spectra_window"] = {c.spectrum_from, c.spectrum_to};
  if (c.modes_until) json["modes_window"] = {c.spectrum_from, *c.modes_until};
  for (const ComparedSpectrum& s : c.spectra) json["spectra"].push_back(SpectrumJson(s));
  for (const OperatingShape& s : c.operating_shapes) {
    json["operating_shapes"].push_back({{"measured_frequency", s.measured_frequency},
                                        {"reference_frequency", s.reference_frequency},
                                        {"amplitude", s.amplitude},
                                        {"mac", s.mac}});
  }
  json["modes"] = {{"signals", c.mode_signals},
                   {"units", c.mode_units},
                   {"measured", ModesJson(c.measured_modes, c.measured_vibration,
                                          c.measured_doubtful, c.measured_ambient)},
                   {"reference", alone ? ordered_json(nullptr)
                                       : ModesJson(c.reference_modes, c.reference_vibration,
                                                   c.reference_doubtful, c.reference_ambient)},
                   {"pairs", ordered_json::array()}};
  for (const ModePair& p : c.mode_pairs) {
    if (p.a < 0 || p.b < 0) continue;
    json["modes"]["pairs"].push_back({{"measured", p.a}, {"reference", p.b}, {"mac", p.mac}});
  }
  return json;
}

}  // namespace unfurl::correlate
