#include "sim/record/certificate_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "base/table.h"
#include "sim/record/certificate.h"

namespace unfurl::sim {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kMostErrors = 12;  // on the terminal; all are in the JSON and the file

double PartOf(const Certificate::Line& line) {
  return line.range > 0.0 ? (line.time + line.mesh) / line.range : 0.0;
}

ordered_json ErrorsJson(const std::vector<Certificate::Line>& lines, const char* whole) {
  ordered_json list = ordered_json::array();
  for (const Certificate::Line& line : lines) {
    list.push_back({{"quantity", line.name},
                    {"units", line.units},
                    {"error_time", line.time},
                    {"error_mesh", line.mesh},
                    {whole, line.range}});
  }
  return list;
}

// Errors, the largest of their `whole` first.
std::string ErrorsTable(std::vector<Certificate::Line> lines, const char* what, const char* whole) {
  std::stable_sort(lines.begin(), lines.end(),
                   [](const auto& a, const auto& b) { return PartOf(a) > PartOf(b); });
  std::vector<std::vector<std::string>> rows = {{what, "time stepping", "mesh", whole}};
  for (std::size_t k = 0; k < std::min(lines.size(), kMostErrors); ++k) {
    const Certificate::Line& line = lines[k];
    rows.push_back({"  " + line.name, fmt::format("{:.2g} {}", line.time, line.units),
                    fmt::format("{:.2g} {}", line.mesh, line.units),
                    fmt::format("{:.2g}%", 100.0 * PartOf(line))});
  }
  std::string text = AlignedTable(rows);
  if (lines.size() > kMostErrors) {
    text += fmt::format("  {} quantities more are in the run\n", lines.size() - kMostErrors);
  }
  return text;
}

}  // namespace

std::string CertificateText(const Certificate& certificate, const SimulateReport& report,
                            ordered_json* json) {
  if (!certificate.problem().empty()) {
    (*json)["certificate"] = {{"problem", certificate.problem()}};
    return fmt::format("numerical error not known: {}\n", certificate.problem());
  }
  const std::vector<Certificate::Line> lines = certificate.Lines();
  const std::vector<Certificate::Line> loads = certificate.LoadLines(report);
  (*json)["certificate"] = {{"mesh", certificate.mesh()},
                            {"errors", ErrorsJson(lines, "range")},
                            {"loads", ErrorsJson(loads, "value")}};
  ordered_json& unknown = (*json)["certificate"]["not_known"] = ordered_json::array();
  for (const Certificate::Unknown& one : certificate.Unknowns(report)) unknown.push_back(one.name);
  std::string text = "numerical error, estimated";
  if (!certificate.mesh().empty()) text += ", the mesh's by " + certificate.mesh();
  text += ":\n" + ErrorsTable(lines, "  quantity", "of its range");
  if (!loads.empty()) text += ErrorsTable(loads, "  load", "of its value");
  return text;
}

}  // namespace unfurl::sim
