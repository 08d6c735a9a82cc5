#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "campaign/answers.h"
#include "campaign/answers_json.h"
#include "campaign/in_process.h"
#include "campaign/record.h"
#include "data/campaign.h"
#include "python/bindings.h"

namespace unfurl::python {
namespace {

using campaign::CampaignRecord;

// A record with the values that its runs had, and what it says.
struct Campaign {
  CampaignRecord record;
  std::vector<std::vector<double>> values;  // by variable, n each
  campaign::CampaignAnswers answers;
};

std::shared_ptr<Campaign> Made(CampaignRecord record) {
  auto out = std::make_shared<Campaign>();
  const campaign::Inputs inputs(record.plan);
  const std::size_t d = record.plan.variables.size();
  out->values.assign(d, std::vector<double>(record.runs));
  std::vector<double> row(d);
  for (std::uint64_t run = 0; run < record.runs; ++run) {
    inputs.Values(run, row);
    for (std::size_t j = 0; j < d; ++j) out->values[j][run] = row[j];
  }
  out->answers = campaign::Answer(record);
  out->record = std::move(record);
  return out;
}

std::shared_ptr<Campaign> RunCampaign(const py::object& plan_path, const py::object& set,
                                      std::size_t workers, bool allow_programs) {
  const std::string path = PathFrom(plan_path, "plan").string();
  const std::vector<std::string> sets = OverridesFrom(set);
  return Long([&] {
    const data::Campaign plan = data::ReadCampaign(path, sets);
    return Made(campaign::RunInProcess(plan, {"unfurl", allow_programs}, workers));
  });
}

py::object ParsedJson(const nlohmann::ordered_json& json) {
  return py::module_::import("json").attr("loads")(
      json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
}

template <class Items>
py::dict Columns(const py::object& self, const Items& items,
                 const std::vector<std::vector<double>>& columns) {
  py::dict out;
  for (std::size_t j = 0; j < items.size(); ++j) {
    out[py::str(items[j].name)] = View(columns[j], self);
  }
  return out;
}

}  // namespace

py::object LoadCampaign(const fs::path& path) {
  return py::cast(Long([&] { return Made(campaign::ReadRecord(path.string())); }));
}

void BindCampaign(py::module_& m) {
  py::class_<Campaign, std::shared_ptr<Campaign>>(
      m, "Campaign", "Many runs of one job over distributions of its numbers, and what they say.")
      .def_property_readonly(
          "name", [](const Campaign& c) { return c.record.plan.name; }, "Of the plan.")
      .def_property_readonly(
          "runs", [](const Campaign& c) { return c.record.runs; },
          "How many, failed ones included.")
      .def_property_readonly(
          "variables",
          [](const py::object& self) {
            const auto& c = self.cast<Campaign&>();
            return Columns(self, c.record.plan.variables, c.values);
          },
          "Value of each variable in each run, arrays of shape (runs,) by name.")
      .def_property_readonly(
          "responses",
          [](const py::object& self) {
            const auto& c = self.cast<Campaign&>();
            return Columns(self, c.record.plan.responses, c.record.responses);
          },
          "Each response of each run, arrays of shape (runs,) by name; yes or no as 1 and 0; NaN\n"
          "where a run failed or has none.")
      .def_property_readonly(
          "failures",
          [](const Campaign& c) {
            std::vector<std::pair<std::uint64_t, std::string>> out;
            for (std::size_t f = 0; f < c.record.failed.size(); ++f) {
              out.emplace_back(c.record.failed[f], c.record.messages[f]);
            }
            return out;
          },
          "Runs that failed, with the reason: a list of (run, message).")
      .def_property_readonly(
          "answers", [](const Campaign& c) { return ParsedJson(campaign::AnswersJson(c.answers)); },
          "What the runs say, as `unfurl campaign --json`: a dict; see docs/campaign.md.")
      .def_property_readonly(
          "usable", [](const Campaign& c) { return c.answers.usable; }, "Some run did not fail.")
      .def_property_readonly(
          "notes", [](const Campaign& c) { return c.answers.notes; },
          "What a reader of the answers must know, a sentence each.")
      .def("__repr__", [](const Campaign& c) {
        return fmt::format("<unfurl.Campaign: '{}', {}, {} failed>", c.record.plan.name,
                           Plural(c.record.runs, "run"), c.record.failed.size());
      });
  m.def("campaign", &RunCampaign, py::arg("plan"), py::kw_only(), py::arg("set") = py::none(),
        py::arg("workers") = 0, py::arg("allow_programs") = false,
        "Runs a plan (a path) in threads of this program.\n\n"
        "set: overrides of the plan, as read_study takes them. workers: at a time; 0: all cores;\n"
        "they do not change the numbers. allow_programs: steps may run other programs than\n"
        "unfurl. A plan of design 'rare', or with 'until', is for the program: `unfurl campaign`.");
}

}  // namespace unfurl::python
