#include "campaign/steps_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/subprocess.h"
#include "base/text.h"
#include "campaign/responses.h"
#include "data/atomic_file.h"
#include "data/scratch_folder.h"

namespace unfurl::campaign {

namespace {

using data::CampaignResponse;
using nlohmann::json;

constexpr char kOurselves[] = "unfurl";
constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

// {NAME} of a word, with nothing but a name between the braces.
std::vector<std::string> NamesInWord(const std::string& word) {
  std::vector<std::string> out;
  for (std::size_t at = 0; (at = word.find('{', at)) != std::string::npos; ++at) {
    const std::size_t end = word.find('}', at);
    if (end == std::string::npos) break;
    const std::string name = word.substr(at + 1, end - at - 1);
    const bool plain = !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) || c == '_';
    });
    if (plain) out.push_back(name);
  }
  return out;
}

// A number, true or false; NaN for null, which is how a summary says that there is none.
double NumberAt(const json& summary, const std::string& pointer) {
  const json& value = summary.at(json::json_pointer(pointer));
  if (value.is_boolean()) return value.get<bool>() ? 1.0 : 0.0;
  if (value.is_null()) return kNoValue;
  return value.get<double>();
}

class StepsJob : public Job {
 public:
  StepsJob(const data::Campaign& plan, const JobOptions& options)
      : plan_(plan), program_(options.program), derived_(plan) {
    for (const std::string& file : plan.job.files) texts_.push_back(data::ReadTextFile(file));
    bool uses_any = false;
    std::vector<std::string> known = {"run", "plan"};
    for (const data::CampaignVariable& v : plan.variables) known.push_back(v.name);
    for (const auto& step : plan.job.steps) {
      if (step.front() != kOurselves && !options.allow_programs) {
        throw Error(fmt::format("wants to run '{}'", step.front()), plan.job.where,
                    "--allow-programs runs the programs that a plan names");
      }
      for (const std::string& word : step) {
        for (const std::string& name : NamesInWord(word)) {
          if (std::find(known.begin(), known.end(), name) == known.end()) {
            throw Error(fmt::format("{{{}}} stands for nothing", name), plan.job.where + ".step",
                        "known here: " + JoinWords(known));
          }
          uses_any = uses_any || name != "plan";
        }
      }
    }
    for (const std::string& text : texts_) {
      for (const data::CampaignVariable& v : plan.variables) {
        uses_any = uses_any || text.find("{{" + v.name + "}}") != std::string::npos;
      }
    }
    if (!uses_any) {
      throw Error("no step and no file has a {VARIABLE}: all runs would be one", plan.job.where,
                  "put {" + plan.variables.front().name + "} where its value belongs");
    }
  }

  RunOutcome Run(std::uint64_t index, std::span<const double> values,
                 std::span<double> responses) override {
    std::fill(responses.begin(), responses.end(), kNoValue);
    const data::ScratchFolder scratch("unfurl-campaign-");
    const auto names = Names(index, values);
    Place(scratch, names);
    std::vector<json> summaries(plan_.job.steps.size());
    for (std::size_t s = 0; s < plan_.job.steps.size(); ++s) {
      std::string why = Step(s, scratch, names, &summaries[s]);
      if (why.empty()) continue;
      // The folder's name differs each time, and a record is to be the same each time.
      data::ReplaceAll(&why, scratch.path() + "/", "");
      return {false, fmt::format("step {}: {}", s + 1, why)};
    }
    for (std::size_t k = 0; k < plan_.responses.size(); ++k) {
      const CampaignResponse& r = plan_.responses[k];
      if (r.source != CampaignResponse::Source::kStep) continue;
      try {
        responses[k] = NumberAt(summaries[static_cast<std::size_t>(r.step)], r.pointer);
      } catch (const json::exception&) {
        std::fill(responses.begin(), responses.end(), kNoValue);
        return {false, fmt::format("step {} says no number at {}", r.step + 1, r.pointer)};
      }
    }
    derived_.Finish(values, responses);
    return {true, {}};
  }

  std::vector<std::string> inputs() const override { return plan_.job.files; }

 private:
  using Named = std::vector<std::pair<std::string, std::string>>;

  Named Names(std::uint64_t index, std::span<const double> values) const {
    const auto folder = std::filesystem::absolute(plan_.path).parent_path();
    Named names = {{"run", fmt::format("{}", index)}, {"plan", folder.string()}};
    for (std::size_t j = 0; j < values.size(); ++j) {
      names.emplace_back(plan_.variables[j].name, fmt::format("{:.17g}", values[j]));
    }
    return names;
  }

  void Place(const data::ScratchFolder& scratch, const Named& names) const {
    for (std::size_t f = 0; f < texts_.size(); ++f) {
      std::string text = texts_[f];
      for (const auto& [key, value] : names) data::ReplaceAll(&text, "{{" + key + "}}", value);
      data::WritePlain(scratch.File(std::filesystem::path(plan_.job.files[f]).filename().string()),
                       text);
    }
  }

  // Why it failed; empty: it did not.
  std::string Step(std::size_t s, const data::ScratchFolder& scratch, const Named& names,
                   json* summary) const {
    std::vector<std::string> words = plan_.job.steps[s];
    for (std::string& word : words) {
      for (const auto& [key, value] : names) data::ReplaceAll(&word, "{" + key + "}", value);
    }
    if (words.front() == kOurselves) {
      words.front() = program_;
      if (std::find(words.begin(), words.end(), "--json") == words.end()) {
        words.emplace_back("--json");
      }
    }
    const std::string out = scratch.File(fmt::format(".step-{}.out", s + 1)),
                      err = scratch.File(fmt::format(".step-{}.err", s + 1));
    const ProgramOutcome outcome = RunProgram(words, scratch.path(), out, err, plan_.job.timeout);
    if (!outcome.started) return fmt::format("{} does not start", words.front());
    if (outcome.timed_out) return fmt::format("not done in {:g} s", plan_.job.timeout);
    if (outcome.code != 0) {
      const std::string last = data::LastLineOf(err);
      return fmt::format("exit code {}{}{}", outcome.code, last.empty() ? "" : ": ", last);
    }
    const bool asked =
        std::any_of(plan_.responses.begin(), plan_.responses.end(), [&](const CampaignResponse& r) {
          return r.source == CampaignResponse::Source::kStep && r.step == static_cast<int>(s);
        });
    if (!asked) return {};
    *summary = json::parse(data::ReadTextFile(out), nullptr, false);
    return summary->is_discarded() ? "does not print JSON" : "";
  }

  data::Campaign plan_;
  std::string program_;
  DerivedResponses derived_;
  std::vector<std::string> texts_;  // of the files
};

}  // namespace

std::unique_ptr<Job> MakeStepsJob(const data::Campaign& plan, const JobOptions& options) {
  return std::make_unique<StepsJob>(plan, options);
}

}  // namespace unfurl::campaign
