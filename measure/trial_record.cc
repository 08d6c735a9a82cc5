#include "measure/trial_record.h"

#include "data/formats.h"
#include "data/h5.h"

namespace unfurl::measure {

TrialRecord::TrialRecord(const std::string& path) : path_(path) {
  const bool csv = data::FormatOf(path) == data::FileFormat::kCsv;
  if (csv || data::H5Reader::SchemaOf(path) == data::kReadingsSchema) {
    readings_ = data::ReadTrialReadings(path);
  } else {
    lines_.emplace(path);
  }
}

std::size_t TrialRecord::size() const { return lines_ ? lines_->size() : readings_->size(); }

double TrialRecord::start() const { return lines_ ? 0.0 : readings_->t.front(); }

double TrialRecord::duration() const {
  return lines_ ? static_cast<double>(lines_->size()) / lines_->header().line_rate
                : readings_->t.back() - readings_->t.front();
}

data::LiveHeader TrialRecord::Header() const {
  data::LiveHeader header;
  header.readings = readings_.has_value();
  if (!readings_) {
    header.trial = lines_->header();
    return header;
  }
  header.trial.cameras = readings_->cameras;
  header.trial.slots = readings_->slots;
  header.pixels = readings_->pixels;
  return header;
}

std::unique_ptr<Reconstructor> TrialRecord::Open(const data::Rig& rig, const std::string& rig_path,
                                                 const ReconstructOptions& options) const {
  if (lines_) return std::make_unique<Reconstructor>(*lines_, rig, rig_path, options);
  return std::make_unique<Reconstructor>(*readings_, rig, rig_path, options);
}

void TrialRecord::Process(std::size_t first, std::size_t count, Reconstructor* reconstructor,
                          data::TrialBlock* block, data::Tracks* tracks) const {
  if (!lines_) {
    reconstructor->Process(*readings_, first, count, tracks);
    return;
  }
  ReadLines(*lines_, reconstructor->options().corrections, first, count, block);
  reconstructor->Process(*block, tracks);
}

data::Tracks Reconstruct(const TrialRecord& record, const data::Rig& rig,
                         const ReconstructOptions& options, ReconstructSummary* summary,
                         bool correct, HealthReport* health) {
  data::TrialBlock block;
  return ReconstructPasses(
      [&](const ReconstructOptions& now) { return record.Open(rig, "the rig", now); },
      [&](std::size_t first, std::size_t count, Reconstructor* pass, data::Tracks* tracks) {
        record.Process(first, count, pass, &block, tracks);
      },
      record.size(), options, summary, correct, health);
}

}  // namespace unfurl::measure
