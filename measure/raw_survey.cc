#include "measure/raw_survey.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "base/error.h"
#include "base/text.h"
#include "data/csv.h"
#include "data/lab.h"
#include "measure/background.h"
#include "measure/raw_lines.h"
#include "measure/spot.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kRawSurveyBlock = 256;  // lines held at once

// What each line shows: a point, or -1 for a dark one.
class LineLabels {
 public:
  LineLabels(const data::RawLayout& layout, const std::vector<std::string>& points)
      : layout_(layout), points_(points.size()) {
    dark_ = static_cast<std::int32_t>(
        std::find(layout.header.slots.begin(), layout.header.slots.end(), data::kDarkSlot) -
        layout.header.slots.begin());
    if (!layout.survey.ids.empty()) ReadIds(points);
  }

  int Of(std::size_t line) const {
    if (!labels_.empty()) {
      if (line < labels_.size()) return labels_[line];
      throw Error(fmt::format("has {} rows, but there are more lines", labels_.size()),
                  layout_.survey.ids, "give a row for each line");
    }
    const auto each = static_cast<std::size_t>(layout_.survey.lines_each);
    if (line / each >= points_) {
      throw Error(fmt::format("there are more lines than {} for each of {} points", each, points_),
                  layout_.files[0].where, "correct survey.lines_each, or give survey.ids");
    }
    const std::size_t turn = (line % each + layout_.first_slot) % layout_.cycle.size();
    return layout_.cycle[turn] == dark_ ? -1 : static_cast<int>(line / each);
  }

  // After the last line.
  void CheckEnd(std::size_t lines) const {
    const std::size_t each = static_cast<std::size_t>(layout_.survey.lines_each);
    const std::size_t expected = labels_.empty() ? points_ * each : labels_.size();
    if (lines == expected) return;
    throw Error(fmt::format("there are {} lines where {} are expected", lines, expected),
                labels_.empty() ? layout_.files[0].where : layout_.survey.ids,
                labels_.empty() ? "correct survey.lines_each, or give survey.ids"
                                : "give a row for each line");
  }

 private:
  void ReadIds(const std::vector<std::string>& points) {
    const data::CsvTable table = data::CsvTable::Load(layout_.survey.ids);
    const int id = table.Require("id", ""), slot = table.Find("slot");
    for (std::size_t row = 0; row < table.rows(); ++row) {
      std::int32_t lit = layout_.cycle[(layout_.first_slot + row) % layout_.cycle.size()];
      if (slot >= 0) {
        const auto& slots = layout_.header.slots;
        const auto at = std::find(slots.begin(), slots.end(), table.Text(row, slot));
        if (at == slots.end()) {
          throw Error(fmt::format("the slot '{}' is not known", table.Text(row, slot)),
                      table.Where(row, slot), "recording.slots lists " + JoinWords(slots));
        }
        lit = static_cast<std::int32_t>(at - slots.begin());
      }
      if (lit == dark_) {
        labels_.push_back(-1);
        continue;
      }
      const auto at = std::find(points.begin(), points.end(), table.Text(row, id));
      if (at == points.end()) {
        throw Error(fmt::format("'{}' is not the id of a surveyed point", table.Text(row, id)),
                    table.Where(row, id), "use the ids of " + layout_.survey.points);
      }
      labels_.push_back(static_cast<int>(at - points.begin()));
    }
  }

  const data::RawLayout& layout_;
  std::size_t points_;
  std::int32_t dark_ = 0;
  std::vector<int> labels_;  // by line; empty: by count
};

}  // namespace

data::ReadingTable ReadRawSurvey(const data::RawLayout& layout,
                                 const std::vector<std::string>& points,
                                 const std::function<void(double)>& progress) {
  const LineLabels labels(layout, points);
  const std::size_t cameras = layout.header.cameras.size();
  // Each line to `use(label, camera, counts)`; the `pass`-th of two.
  const auto each_line = [&](RawLines& lines, int pass, auto&& use) {
    data::TrialBlock block;
    std::size_t line = 0;
    while (lines.Read(kRawSurveyBlock, &block)) {
      for (std::size_t i = 0; i < block.size(); ++i, ++line) {
        const int label = labels.Of(line);
        for (std::size_t c = 0; c < cameras; ++c) {
          use(label, c, block.Line(layout.header, i, c));
        }
      }
      progress(0.5 * (pass + lines.done()));
    }
    labels.CheckEnd(line);
  };

  const data::LineFormats& format = layout.header.format;
  std::vector<Background> backgrounds;
  for (std::size_t c = 0; c < cameras; ++c) backgrounds.emplace_back(format.Of(c));
  RawLines first(layout);
  std::vector<char> lit(points.size(), 0);
  each_line(first, 0, [&](int label, std::size_t c, std::span<const std::uint16_t> line) {
    if (label < 0) {
      backgrounds[c].Add(line);
    } else {
      lit[static_cast<std::size_t>(label)] = 1;
    }
  });
  const auto dark_point = std::find(lit.begin(), lit.end(), 0);
  if (backgrounds[0].empty() || dark_point != lit.end()) {
    throw Error(backgrounds[0].empty()
                    ? std::string("no line is dark")
                    : fmt::format("point '{}' has no lit line",
                                  points[static_cast<std::size_t>(dark_point - lit.begin())]),
                layout.survey.ids.empty() ? layout.path : layout.survey.ids,
                "record both for each point");
  }

  data::ReadingRepeats repeats;
  for (const std::string& id : points) repeats.Point(id);
  for (const std::string& name : layout.header.cameras) repeats.Camera(name);
  std::vector<SpotFinder> finders;
  for (std::size_t c = 0; c < cameras; ++c) finders.emplace_back(format.Of(c));
  RawLines second(layout);
  SetResponses(second.header().response, finders);
  each_line(second, 1, [&](int label, std::size_t c, std::span<const std::uint16_t> line) {
    if (label < 0) return;
    const Spot spot = finders[c].Find(line, backgrounds[c]);
    if (Usable(spot)) repeats.Add(static_cast<std::size_t>(label), c, spot.u_px, spot.s_px);
  });
  data::ReadingTable out = repeats.Average();
  for (std::size_t c = 0; c < cameras; ++c) out.pixels.push_back(format.Of(c).active);
  return out;
}

}  // namespace unfurl::measure
