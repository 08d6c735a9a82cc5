#include "correlate/compare/channel_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>

#include "base/count.h"
#include "base/error.h"
#include "base/number.h"
#include "base/text.h"
#include "correlate/compare/clock_words.h"
#include "correlate/compare/comparison_measures.h"
#include "correlate/compare/wrong_readings.h"
#include "correlate/residual/channel.h"
#include "correlate/residual/row_layout.h"
#include "data/csv.h"
#include "data/formats.h"
#include "data/h5.h"
#include "data/units.h"

namespace unfurl::correlate {

namespace {

std::vector<data::Channel> ChannelsOfTracks(const std::string& path) {
  const Observations o = FromTracks(data::ReadTracksAny(path));
  std::vector<data::Channel> out;
  for (const MarkSeries& m : o.marks) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      data::Channel c;
      c.name = m.name + "." + "xyz"[axis];
      c.unit = "m";
      c.where = path;
      c.t = m.t;
      for (Eigen::Index i = 0; i < m.p.cols(); ++i) {
        c.y.push_back(m.p(axis, i));
        // xx, yy and zz of xx, xy, xz, yy, yz, zz.
        constexpr Eigen::Index kDiagonal[] = {0, 3, 5};
        if (o.has_sigma) c.sigma.push_back(std::sqrt(m.cov(kDiagonal[axis], i)));
      }
      out.push_back(std::move(c));
    }
  }
  return out;
}

// Pairs of equal names, and what only one of the two has.
std::vector<ChannelName> SharedNames(const std::vector<data::Channel>& record,
                                     const std::vector<data::Channel>& reference, Comparison* c) {
  auto names_of = [](const std::vector<data::Channel>& list) {
    std::vector<std::string> out;
    out.reserve(list.size());
    for (const data::Channel& one : list) out.push_back(one.name);
    return out;
  };
  const std::vector<std::string> a = names_of(record), b = names_of(reference);
  std::vector<ChannelName> out;
  for (const std::string& name : a) {
    if (std::find(b.begin(), b.end(), name) != b.end()) {
      out.push_back({name, name});
    } else {
      c->left_out.push_back(name);
    }
  }
  if (out.empty()) {
    throw Error(
        "no channel has the same name in both", c->record + " and " + c->reference,
        "say which are the same, --channels NAME=ITS_NAME_IN_THE_REFERENCE; the first has " +
            JoinWords(a) + ", the second " + JoinWords(b));
  }
  return out;
}

// The reading over the reference's unit; refuses what does not measure the same.
double ScaleOf(const data::Channel& of_record, const data::Channel& of_reference) {
  const auto scale = data::UnitsPer(of_record.unit, of_reference.unit);
  if (scale) return *scale;
  auto unit = [](const data::Channel& c) {
    return c.unit.empty() ? "no unit" : "'" + c.unit + "'";
  };
  throw Error(fmt::format("'{}' is in {}, and '{}' in {}", of_record.name, unit(of_record),
                          of_reference.name, unit(of_reference)),
              of_record.where,
              "compare what measures the same; state units as 'NAME [unit]' in the file");
}

Eigen::VectorXd AsVector(const std::vector<double>& x) {
  return Eigen::Map<const Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size()));
}

// Whether a reference that has readings at `stamps` says something at a time [s]: not after the
// last of them, nor in a gap. Before the first, only what it says of a structure that is held.
bool Says(const std::vector<double>& stamps, double widest, double t, bool held) {
  const auto after = std::upper_bound(stamps.begin(), stamps.end(), t);
  if (after == stamps.begin()) return held;
  if (after == stamps.end()) return t == stamps.back();
  return *after - *(after - 1) <= widest;
}

void AddSignal(const Channel& channel, const Eigen::VectorXd& shown,
               const std::vector<double>& stamps, const ResidualKind::Clocks& clocks,
               Comparison* c) {
  const ChannelRecord& r = channel.record();
  ComparedSignal s;
  s.id.kind = SignalId::Kind::kChannel;
  s.id.mark = c->channels.size();
  s.id.unit = r.unit;
  s.name = r.name;
  // A residual of exactly 0 stands for "not known"; after the first known one and before the last
  // it is also what equal readings leave.
  Eigen::Index first = 0, last = shown.size() - 1;
  while (first <= last && std::isnan(shown(first))) ++first;
  while (last > first && std::isnan(shown(last))) --last;
  const double widest = SampledModel::kMaxGap * MedianStep(stamps);
  const std::vector<std::uint8_t>* aside = channel.series().front().aside;
  for (std::size_t i = 0; i < r.t.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const double value = shown(at), y = r.y(at);
    const bool known = !std::isnan(value);
    if (at < first || at > last || (aside != nullptr && (*aside)[i] != 0)) continue;
    const double t = channel.TimeOf(at);  // by the record's clock
    if (!Says(stamps, widest, clocks.at.ModelTime(t, clocks.pivot), known)) continue;
    s.t.push_back(t);
    s.measured.push_back(y);
    s.reference.push_back(known ? value : y);
    if (channel.has_sigma()) s.sigma.push_back(r.sigma(at));
  }
  c->channels.push_back({r.name, r.unit, r.quantity});
  c->signals.push_back(std::move(s));
}

void AddChannelReasons(Comparison* c) {
  const Alignment& a = c->alignment;
  for (std::string& words : ClockWords(*c, "all channels together", "")) {
    c->reasons.push_back(std::move(words));
  }
  for (std::string& words : ContradictionsOf(c->observations, a)) {
    c->reasons.push_back(std::move(words));
  }
  const RowLayout layout(c->observations);
  const auto clocks = ClocksOf(c->observations, a.at.clock(), a.at.clock());
  for (std::size_t k = 0; k < c->observations.others.size(); ++k) {
    const ResidualKind& kind = *c->observations.others[k];
    const auto words =
        kind.Words(kind.NumbersOf(a.reference), clocks, layout.OwnOf(k, a.at.own), "");
    c->reasons.insert(c->reasons.end(), words.begin(), words.end());
  }
  if (!c->left_out.empty()) {
    c->reasons.push_back("Only one of the two has " + JoinWords(c->left_out) + ": left out.");
  }
}

void JudgeChannels(Comparison* c) {
  const ComparedScore* worst = nullptr;
  for (const ComparedScore& s : c->scores) {
    if (std::isfinite(s.score.r2) && (worst == nullptr || s.score.r2 < worst->score.r2)) worst = &s;
  }
  if (worst == nullptr) {
    c->verdict = "Nothing moves that could be compared.";
  } else {
    c->verdict = fmt::format(
        "The two explain {:.4g}% of what the {} show{}: {} RMS{}.", 100.0 * worst->score.r2,
        c->scores.size() == 1 ? "readings" : "least alike readings",
        fmt::format(" ({})", worst->name),
        Number(worst->score.rmse, 3) + (worst->unit.empty() ? "" : " " + worst->unit),
        worst->sigmas > 0.0 ? fmt::format(", {:.2g} times their sigma", worst->sigmas) : "");
  }
}

bool IsRun(const std::string& path) {
  return data::FormatOf(path) == data::FileFormat::kHdf5 && !HoldsChannels(path) &&
         data::KindOf(path) == data::kRunSchema;
}

// The steps that a found alignment is followed by, and those that a record alone has.
void Measure(const ComparisonOptions& options, Comparison* c) {
  if (!c->reference.empty()) FillScores(c);
  FillSpectra(options, c);
  FillModes(options, c);
}

void TakePlacement(const Placement& said, bool clock_drift, Placement* known) {
  if (said.offset.kind != Foreknowledge::kUnsaid) known->offset = said.offset;
  if (said.drift.kind != Foreknowledge::kUnsaid) known->drift = said.drift;
  if (clock_drift && known->drift.kind == Foreknowledge::kUnsaid) known->drift = Prior::Free();
}

// What was computed has no wrong readings: what it holds or does at once is motion.
bool IsComputed(const std::string& name) {
  return std::filesystem::is_regular_file(name) && IsRun(name);
}

Channel InstrumentOf(const data::Channel& of_record, const data::Channel& of_reference,
                     bool computed) {
  ChannelRecord r;
  r.name = of_record.name;
  r.quantity = of_reference.name;
  r.unit = of_record.unit;
  r.scale = ScaleOf(of_record, of_reference);
  r.t = of_record.t;
  r.y = AsVector(of_record.y);
  r.sigma = AsVector(of_record.sigma);
  if (!computed) LeaveOutHeld(&r);
  return Channel(std::move(r), of_record.where);
}

// The pairs wanted, each of the record's as an instrument that reads the reference's.
std::vector<ChannelName> PairUp(const std::vector<data::Channel>& record,
                                const std::vector<data::Channel>& reference,
                                const std::vector<ChannelName>& names, Comparison* c) {
  c->observations.has_sigma = false;
  const bool computed = IsComputed(c->record);
  std::vector<ChannelName> pairs = names.empty() ? SharedNames(record, reference, c) : names;
  for (ChannelName& pair : pairs) {
    if (pair.of.empty()) pair.of = pair.name;
    const data::Channel& a = data::FindChannel(record, pair.name, c->record);
    const data::Channel& b = data::FindChannel(reference, pair.of, c->reference);
    c->observations.others.push_back(std::make_shared<Channel>(InstrumentOf(a, b, computed)));
  }
  return pairs;
}

}  // namespace

ChannelName ParseChannelName(const std::string& text, const std::string& where) {
  const std::size_t equals = text.find('=');
  ChannelName out{text.substr(0, equals),
                  equals == std::string::npos ? "" : text.substr(equals + 1)};
  if (out.name.empty() || (equals != std::string::npos && out.of.empty())) {
    throw Error("'" + text + "' names no channel", where,
                "say NAME, or NAME=ITS_NAME_IN_THE_REFERENCE");
  }
  return out;
}

bool HoldsChannels(const std::string& path) {
  switch (data::FormatOf(path)) {
    case data::FileFormat::kCsv:
      return data::CsvTable::Load(path).Find("mark") < 0;
    case data::FileFormat::kHdf5:
      return !data::H5Reader(path, "", 0).HasAttribute("/", "schema");
    default:
      return false;
  }
}

std::vector<data::Channel> ChannelsOf(const std::string& path) {
  const data::FileFormat format = data::FormatOf(path);
  const bool tracks = format == data::FileFormat::kC3d ||
                      (format == data::FileFormat::kCsv && !HoldsChannels(path)) ||
                      (format == data::FileFormat::kHdf5 && !HoldsChannels(path) &&
                       data::KindOf(path) == data::kTracksSchema);
  return tracks ? ChannelsOfTracks(path) : data::ReadChannels(path);
}

Comparison CompareChannels(const std::vector<data::Channel>& record,
                           const std::vector<data::Channel>& reference,
                           const std::vector<ChannelName>& names, const ComparisonOptions& options,
                           const std::string& record_name, const std::string& reference_name) {
  Comparison c;
  c.record = record_name;
  c.reference = reference_name;
  c.record_is_test = false;
  const std::vector<ChannelName> pairs = PairUp(record, reference, names, &c);
  Stamps stamps;
  QuantityTimes times;
  Prediction prediction;
  prediction.held_before = false;  // nothing is known of a record before its first reading
  for (const ChannelName& pair : pairs) {
    const data::Channel& b = data::FindChannel(reference, pair.of, reference_name);
    stamps.quantities.push_back({b.name, b.name, b.t});
    times[b.name] = b.t;
    prediction.quantities.push_back({b.name, AsVector(b.y)});
  }
  CompareInstruments(SampledModel(stamps, std::move(prediction)), times, options, &c);
  return c;
}

Comparison CompareChannels(const std::string& record, const std::string& reference,
                           const std::vector<ChannelName>& names,
                           const ComparisonOptions& options) {
  const std::vector<data::Channel> a = ChannelsOf(record), b = ChannelsOf(reference);
  if (!IsRun(reference)) return CompareChannels(a, b, names, options, record, reference);
  const data::Run run = data::ReadRun(reference);
  Comparison c;
  c.record = record;
  c.reference = reference;
  c.record_is_run = IsRun(record);
  PairUp(a, b, names, &c);
  CompareInstruments(run, options, &c);
  return c;
}

void CompareInstruments(const data::Run& run, const ComparisonOptions& options, Comparison* c) {
  c->reference_is_run = true;
  c->record_is_test = !c->record_is_run;
  c->observations.has_sigma = false;
  std::vector<std::string> quantities;
  QuantityTimes times;
  for (const auto& kind : c->observations.others) {
    const auto* channel = dynamic_cast<const Channel*>(kind.get());
    if (channel == nullptr) continue;
    quantities.push_back(channel->record().quantity);
    times[quantities.back()] = run.t;
  }
  for (const data::RunEvent& e : run.events) {
    if (e.kind == "latch") c->latches.push_back({e.t, e.kind, e.where});
  }
  CompareInstruments(SampledModel(run, {}, quantities), times, options, c);
}

void CompareInstruments(const SampledModel& reference, const QuantityTimes& stamps,
                        const ComparisonOptions& options, Comparison* c) {
  TakePlacement(options.placement, options.clock_drift, &c->observations.placement);
  Alignment& a = c->alignment;
  std::vector<ChannelGross> gross;
  a = IsComputed(c->record) ? Align(c->observations, reference)
                            : AlignWithoutGross(reference, &c->observations, &gross);
  if (!a.Usable()) {
    c->verdict = std::string("Not correlated: ") + Name(a.status) + ".";
    c->reasons.push_back(a.message + ".");
    return;
  }
  const Clock clock = a.at.clock();
  a.reference = reference.Evaluate({}, c->observations.StampsAt(clock));
  const ResidualKind::Clocks clocks = ClocksOf(c->observations, clock, clock);
  const RowLayout layout(c->observations);
  for (std::size_t k = 0; k < c->observations.others.size(); ++k) {
    const auto* channel = dynamic_cast<const Channel*>(c->observations.others[k].get());
    if (channel == nullptr) continue;
    const Eigen::VectorXd shown =
        channel->Simulated(channel->NumbersOf(a.reference), clocks, layout.OwnOf(k, a.at.own));
    AddSignal(*channel, shown, stamps.at(channel->record().quantity), clocks, c);
  }
  Measure(options, c);
  JudgeChannels(c);
  AddChannelReasons(c);
  for (std::string& words : GrossWords(c->observations, gross)) {
    c->reasons.push_back(std::move(words));
  }
  AddModeReasons(c);
  AddPeakReasons(c);
}

Comparison DescribeChannels(const std::vector<data::Channel>& record,
                            const std::vector<std::string>& names, const ComparisonOptions& options,
                            const std::string& record_name) {
  Comparison c;
  c.record = record_name;
  c.observations.has_sigma = false;
  c.alignment.status = AlignStatus::kGood;
  c.alignment.message = "a record alone";
  c.alignment.overlap_start = std::numeric_limits<double>::infinity();
  c.alignment.overlap_end = -c.alignment.overlap_start;
  const bool computed = IsComputed(record_name);
  std::vector<const data::Channel*> wanted;
  wanted.reserve(std::max(names.size(), record.size()));
  for (const std::string& name : names) {
    wanted.push_back(&data::FindChannel(record, name, record_name));
  }
  if (names.empty()) {
    for (const data::Channel& one : record) wanted.push_back(&one);
  }
  for (const data::Channel* one : wanted) {
    if (one->t.empty()) continue;
    ComparedSignal s;
    s.id.kind = SignalId::Kind::kChannel;
    s.id.mark = c.channels.size();
    s.id.unit = one->unit;
    s.name = one->name;
    s.t = one->t;
    s.measured = one->y;
    s.sigma = one->sigma;
    if (!computed) {
      for (std::string& words : TakeOutWrong(s.name, one->unit, {&s.t, &s.measured, &s.sigma})) {
        c.reasons.push_back(std::move(words));
      }
    }
    c.alignment.overlap_start = std::min(c.alignment.overlap_start, s.t.front());
    c.alignment.overlap_end = std::max(c.alignment.overlap_end, s.t.back());
    c.channels.push_back({s.name, s.id.unit, ""});
    c.signals.push_back(std::move(s));
  }
  if (c.signals.empty()) throw Error("holds no readings", record_name, "give a file with some");
  Measure(options, &c);
  c.verdict =
      fmt::format("A record alone: {}, {:.6g} to {:.6g} s.", Counted(c.channels.size(), "channel"),
                  c.alignment.overlap_start, c.alignment.overlap_end);
  AddModeReasons(&c);
  return c;
}

}  // namespace unfurl::correlate
