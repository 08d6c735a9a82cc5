#include "data/study_instrument.h"

namespace unfurl::data {

namespace {

using StudyInstrumentKnowledge = StudyKnowledge::Kind;

StudyChannel::Filter ReadFilter(const TomlTable& t) {
  StudyChannel::Filter out;
  out.kind = t.Choice("kind", {"butterworth", "bessel", "average"});
  if (out.kind == "average") {
    out.width = t.Number("width", kPositive);
    return out;
  }
  constexpr int kHighestOrder = 10;  // of the filters that instruments have
  out.order = t.Integer("order", 1, kHighestOrder);
  out.cutoff = t.Number("cutoff", kPositive);
  return out;
}

}  // namespace

StudyKnowledge ReadKnowledge(const TomlTable& t, const char* key, TomlRange range) {
  StudyKnowledge out;
  if (!t.Has(key)) return out;
  if (t.IsNumber(key)) {
    out.kind = StudyInstrumentKnowledge::kKnown;
    out.mean = t.Number(key, range);
  } else if (t.IsTable(key)) {
    const TomlTable density = t.Table(key);
    out.kind = StudyInstrumentKnowledge::kNormal;
    out.mean = density.NumberOr("mean", 0.0, range);
    out.sigma = density.Number("sigma", kPositive);
  } else {
    out.kind = t.Choice(key, {"free", "known"}) == "free" ? StudyInstrumentKnowledge::kFree
                                                          : StudyInstrumentKnowledge::kKnown;
  }
  return out;
}

void ReadInstrument(const TomlTable& t, StudyChannel* c) {
  constexpr TomlRange kRate{-0.5, 0.5};  // a clock that is further off is another one
  c->quantity = t.String("quantity");
  c->unit = t.StringOr("unit", "");
  if (t.Has("sigma")) c->sigma = t.Number("sigma", kPositive);
  if (t.Has("resolution")) c->resolution = t.Number("resolution", kPositive);
  c->gain = ReadKnowledge(t, "gain", kAny);
  if (c->gain.kind == StudyInstrumentKnowledge::kKnown && !t.IsNumber("gain")) c->gain.mean = 1.0;
  if (c->gain.kind == StudyInstrumentKnowledge::kKnown && c->gain.mean == 0.0) {
    t.Fail("gain", "a channel of gain 0 shows nothing", "leave it out");
  }
  c->bias = ReadKnowledge(t, "bias", kAny);
  c->delay = ReadKnowledge(t, "delay", kAny);
  c->drift = ReadKnowledge(t, "drift", kRate);
  if (const auto filter = t.TableOrNone("filter")) c->filter = ReadFilter(*filter);
}

void ReadSwitch(const TomlTable& t, StudyChannel* c) {
  constexpr int kMostEdges = 1'000'000;  // as many as the readings of a channel
  c->event = t.Choice("event", {"latch", "contact_start", "contact_end", "watch"});
  c->joint = t.String(c->event == "watch" ? "watch" : "joint");
  c->rising = t.ChoiceOr("edge", "rising", {"rising", "falling"}) == "rising";
  if (t.Has("bounce")) c->bounce = t.Number("bounce", kPositive);
  if (t.Has("count")) c->count = t.Integer("count", 1, kMostEdges);
  c->delay = ReadKnowledge(t, "delay", kAny);
  if (c->delay.kind != StudyInstrumentKnowledge::kUnsaid &&
      c->delay.kind != StudyInstrumentKnowledge::kKnown) {
    t.Fail("delay", "the delay of a switch is known or not there", "give a number of seconds");
  }
}

}  // namespace unfurl::data
