#include "cli/paper_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "base/error.h"
#include "cli/comparison_panels.h"
#include "cli/verb_files.h"
#include "data/atomic_file.h"
#include "report/still.h"

namespace unfurl::cli {

namespace {

constexpr const char* kTurn = "figure-15.svg";
constexpr const char* kDisplacements[] = {"figure-16a.svg", "figure-16b.svg"};
constexpr const char* kSpectrum = "figure-17.svg";

}  // namespace

std::vector<std::string> PaperFigureNames() {
  return {kTurn, kDisplacements[0], kDisplacements[1], kSpectrum};
}

std::string WritePaperFigures(const std::string& folder, const correlate::Comparison& c) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) {
    throw Error("the folder cannot be made: " + failed.message(), folder,
                "name one that can be written to", ErrorKind::kMachine);
  }
  std::string written;
  auto write = [&](const std::string& name, report::Chart chart, const std::string& title) {
    chart.title = title;
    if (chart.x.label.empty()) chart.x = {"time", "s", false};
    const std::string path = (std::filesystem::path(folder) / name).string();
    data::WriteTextFile(path,
                        "<!-- " + MadeByWords("correlate") + "` -->\n" + report::StillSvg(chart));
    written += fmt::format("wrote {}: {}\n", path, title);
  };
  const auto angle =
      std::find_if(c.signals.begin(), c.signals.end(),
                   [](const correlate::ComparedSignal& s) { return s.id.IsAngle(); });
  if (angle != c.signals.end()) {
    write(kTurn, AngleChart(c, *angle), "Turn of the central body (" + angle->name + ")");
  } else {
    written += "no figure 15: no two marks sit on one body, so no angle is measured\n";
  }
  const std::vector<std::size_t> marks = MarksByMotion(c);
  for (std::size_t i = 0; i < std::min<std::size_t>(marks.size(), 2); ++i) {
    // The paper shows the inner mark first.
    const std::size_t mark = marks[std::min<std::size_t>(marks.size(), 2) - 1 - i];
    write(kDisplacements[i], MarkChart(c, mark, MarkOrigin::kReferenceStart),
          "Displacement of " + c.marks[mark]);
  }
  const correlate::ComparedSpectrum* strongest = nullptr;
  double most = 0.0;
  for (const correlate::ComparedSpectrum& s : c.spectra) {
    if (marks.empty() || s.id.IsAngle() || s.id.mark != marks.front()) continue;
    const double peak = s.measured_peaks.empty() ? 0.0 : s.measured_peaks.front().amplitude;
    if (strongest == nullptr || peak > most) strongest = &s, most = peak;
  }
  if (strongest != nullptr) {
    report::Chart chart = SpectrumChart(c, *strongest);
    write(kSpectrum, chart, "Spectrum of " + strongest->name);
  } else {
    written += "no figure 17: too few samples after the last latch for a spectrum\n";
  }
  return written;
}

}  // namespace unfurl::cli
