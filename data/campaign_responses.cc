#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "base/error.h"
#include "data/beside.h"
#include "data/campaign_reader.h"

namespace unfurl::data {

namespace {

using Source = CampaignResponse::Source;

const std::vector<std::string> kOfQuantity = {"largest", "smallest", "peak",  "range",
                                              "mean",    "rms",      "final", "at"};
const std::vector<std::string> kOfEvent = {"happened", "time", "number"};
const std::vector<std::string> kEvents = {"latch", "contact_start", "contact_end", "watch"};

constexpr int kMostCount = 1'000'000;  // of an event: beyond what a run keeps
constexpr int kMostSteps = 1000;       // what an integer key may say

void ReadWindow(const TomlTable& t, CampaignResponse* r) {
  r->from = t.NumberOr("from", 0.0, kNonNegative);
  r->to = t.NumberOr("to", r->to, kPositive);
  if (!(r->from < r->to)) t.Fail("to", "lies before 'from'", "give from < to");
}

void ReadQuantity(const TomlTable& t, CampaignResponse* r) {
  r->source = Source::kQuantity;
  r->quantity = t.String("quantity");
  r->of = t.ChoiceOr("of", "peak", kOfQuantity);
  if (r->of == "at") {
    r->at = t.Number("at", kNonNegative);
  } else if (r->of != "final") {
    ReadWindow(t, r);
  }
}

void ReadEvent(const TomlTable& t, CampaignResponse* r) {
  r->source = Source::kEvent;
  r->event = t.Choice("event", kEvents);
  r->joint = t.StringOr("where", "");
  r->of = t.ChoiceOr("of", "happened", kOfEvent);
  r->count = t.IntegerOr("count", 1, 1, kMostCount);
  r->yes_no = r->of == "happened";
  ReadWindow(t, r);
}

void ReadStepResponse(const TomlTable& t, const Campaign& plan, CampaignResponse* r) {
  r->source = Source::kStep;
  r->pointer = t.String("pointer");
  if (r->pointer.empty() || r->pointer[0] != '/') {
    t.Fail("pointer", "does not begin with '/'", "write \"/summary/rms\", say (RFC 6901)");
  }
  const int steps = static_cast<int>(plan.job.steps.size());
  r->step = t.IntegerOr("step", steps, 1, kMostSteps) - 1;
  if (r->step >= steps) {
    t.Fail("step", fmt::format("there are {} steps", steps), "count from 1");
  }
}

Source SourceOf(const TomlTable& t, const Campaign& plan) {
  const bool scene = !plan.job.scene.empty();
  std::vector<std::pair<const char*, Source>> forms = {{"expression", Source::kExpression}};
  if (scene) {
    forms.emplace_back("quantity", Source::kQuantity);
    forms.emplace_back("event", Source::kEvent);
  } else {
    forms.emplace_back("pointer", Source::kStep);
  }
  const char* remedy =
      scene ? "give one of quantity, event, expression" : "give one of pointer, expression";
  const char* found = nullptr;
  Source source = Source::kExpression;
  for (const auto& [key, of] : forms) {
    if (!t.Has(key)) continue;
    if (found != nullptr) t.Fail(key, fmt::format("stands beside '{}'", found), remedy);
    found = key;
    source = of;
  }
  if (found == nullptr) t.Fail("", "does not say where it comes from", remedy);
  return source;
}

void ReadThreshold(const TomlTable& t, CampaignResponse* r) {
  if (t.Has("above")) r->above = t.Number("above");
  if (t.Has("below")) r->below = t.Number("below");
  if (!r->above && !r->below) return;
  if (r->yes_no) {
    t.Fail(r->above ? "above" : "below", "is for a number, and this is yes or no", "leave it out");
  }
  if (r->above && r->below && !(*r->above < *r->below)) {
    t.Fail("below", "is not above 'above'", "yes is where the number lies between the two");
  }
  r->yes_no = true;
}

CampaignResponse ReadResponse(const TomlTable& t, const std::string& name, const Campaign& plan) {
  CampaignResponse r;
  r.name = name;
  r.where = t.Where();
  CheckCampaignName(t, name);
  switch (SourceOf(t, plan)) {
    case Source::kQuantity:
      ReadQuantity(t, &r);
      break;
    case Source::kEvent:
      ReadEvent(t, &r);
      break;
    case Source::kStep:
      ReadStepResponse(t, plan, &r);
      break;
    case Source::kExpression:
      r.source = Source::kExpression;
      r.expression = t.String("expression");
      break;
  }
  r.unit = t.StringOr("unit", "");
  ReadThreshold(t, &r);
  return r;
}

}  // namespace

void CheckCampaignName(const TomlTable& t, const std::string& name) {
  const bool good = !name.empty() && !std::isdigit(static_cast<unsigned char>(name[0])) &&
                    std::all_of(name.begin(), name.end(), [](char c) {
                      return std::isalnum(static_cast<unsigned char>(c)) || c == '_';
                    });
  if (!good) {
    t.Fail("", "the name has more than letters, digits and _, or begins with a digit",
           "expressions use it: write latch_time, say");
  }
  const std::vector<std::string> taken = {"run", "_pi", "_e"};
  if (std::find(taken.begin(), taken.end(), name) != taken.end()) {
    t.Fail("", "the name has a meaning of its own", "take another one");
  }
}

void ReadCampaignJob(const TomlTable& job, Campaign* plan) {
  CampaignJob& out = plan->job;
  out.where = job.Where();
  const std::vector<TomlTable> steps = job.TableArray("step");
  if (job.Has("scene") == !steps.empty()) {
    job.Fail("scene", steps.empty() ? "is missing, and there are no steps" : "stands beside steps",
             "give scene = \"FILE\", or [[job.step]] with run = [\"unfurl\", ...]");
  }
  if (job.Has("scene")) {
    out.scene = Beside(plan->path, job.String("scene"));
    out.set = job.StringsOr("set", {});
    out.rtol = job.NumberOr("rtol", 1e-6, {1e-13, 1e-2});
    out.duration = job.NumberOr("duration", 0.0, kPositive);
    out.rate = job.NumberOr("rate", 0.0, kPositive);
    return;
  }
  for (const TomlTable& step : steps) {
    out.steps.push_back(step.Strings("run"));
    if (out.steps.back().empty()) step.Fail("run", "holds no words", "name a program first");
  }
  for (const std::string& file : job.StringsOr("files", {})) {
    out.files.push_back(Beside(plan->path, file));
    plan->inputs.push_back(out.files.back());
  }
  out.timeout = job.NumberOr("timeout", 600.0, kPositive);
}

void ReadCampaignResponses(const TomlTable& root, Campaign* plan) {
  for (const auto& [name, table] : root.NamedTables("response")) {
    for (const CampaignVariable& v : plan->variables) {
      if (v.name == name) table.Fail("", "is a variable's name, too", "take another one");
    }
    plan->responses.push_back(ReadResponse(table, name, *plan));
  }
  if (plan->responses.empty()) {
    throw Error("there is no [response.NAME]", plan->path, "say what each run is asked for");
  }
}

}  // namespace unfurl::data
