#include "cli/live_output.h"

#include <fmt/format.h>
#include <limits.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <iterator>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/progress.h"
#include "data/provenance.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

std::string Text(const ordered_json& value) {
  return value.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

ordered_json LiveOutputFinite(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

}  // namespace

void WholeLines::Flush() {
  for (std::size_t at = 0; enabled_ && at < text_.size();) {
    std::size_t n = text_.size() - at;
    if (n > PIPE_BUF) {
      const std::size_t end = text_.rfind('\n', at + PIPE_BUF - 1);
      const bool fits = end != std::string::npos && end >= at;
      n = (fits ? end : text_.find('\n', at)) - at + 1;
    }
    const ssize_t written = write(STDOUT_FILENO, &text_[at], n);
    if (written < 0 && errno == EINTR) {
      ThrowIfInterrupted();
      continue;
    }
    if (written < 0) {
      throw Error(fmt::format("cannot write: {}", std::strerror(errno)), "standard output",
                  "free some space or redirect it elsewhere", ErrorKind::kMachine);
    }
    at += static_cast<std::size_t>(written);
  }
  text_.clear();
}

void Durations::Add(double seconds, std::size_t times) {
  const double step = std::floor(kPerDecade * (std::log10(std::max(seconds, 1e-7)) + 7.0));
  const auto last = static_cast<double>(counts_.size() - 1);
  counts_[static_cast<std::size_t>(std::clamp(step, 0.0, last))] += times;
  count_ += times;
  most_ = std::max(most_, seconds);
}

double Durations::Quantile(double share) const {
  const double wanted = share * static_cast<double>(count_);
  double sum = 0.0;
  for (std::size_t k = 0; k < counts_.size(); ++k) {
    sum += static_cast<double>(counts_[k]);
    if (sum >= wanted && sum > 0.0) {
      if (k == 0) return 0.0;
      return std::min(most_, std::pow(10.0, static_cast<double>(k + 1) / kPerDecade - 7.0));
    }
  }
  return 0.0;
}

void LiveJson::Line(const ordered_json& object) { out_->text() += Text(object) + "\n"; }

void LiveJson::Listening(const std::string& address) {
  Line({{"type", "listening"}, {"address", address}});
}

void LiveJson::Begun(const measure::Reconstructor& pass) {
  const data::Tracks& layout = pass.layout();
  for (const std::string& name : layout.cameras) cameras_.push_back(Text(name));
  for (const std::string& name : layout.marks) marks_.push_back(Text(name));
  Line({{"type", "begin"},
        {"version", 1},
        {"program", data::ProgramVersion()},
        {"frame", layout.frame},
        {"cameras", layout.cameras},
        {"marks", layout.marks},
        {"most_waiting_s", pass.tracking().motion.longest_gap()},
        {"max_speed_m_s", pass.tracking().motion.max_speed}});
}

void LiveJson::Names(std::uint32_t cameras) {
  std::string& text = out_->text();
  bool first = true;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    if ((cameras >> c & 1U) == 0) continue;
    if (!first) text += ',';
    first = false;
    text += cameras_[c];
  }
}

void LiveJson::Samples(const data::Tracks& tracks) {
  std::string& text = out_->text();
  const auto to = std::back_inserter(text);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const auto col = static_cast<Eigen::Index>(i);
    fmt::format_to(to, R"({{"type":"sample","t":{},"mark":{},"status":"{}")", tracks.t[i],
                   marks_[static_cast<std::size_t>(tracks.mark[i])], data::Name(tracks.status[i]));
    window_.Add(std::max(0.0, (*live_)->t() - tracks.t[i]));
    if (data::Usable(tracks.status[i])) {
      const auto p = tracks.p.col(col);
      const auto own = tracks.cov.col(col);
      fmt::format_to(to, R"(,"p":[{},{},{}],"cov":[{},{},{},{},{},{}])", p(0), p(1), p(2), own(0),
                     own(1), own(2), own(3), own(4), own(5));
      const auto F = tracks.shared.middleCols(col * tracks.shared_rank, tracks.shared_rank);
      const Eigen::Matrix3d C = F * F.transpose();
      fmt::format_to(to, R"(,"cov_rig":[{},{},{},{},{},{}],"used":[)", C(0, 0), C(0, 1), C(0, 2),
                     C(1, 1), C(1, 2), C(2, 2));
      Names(tracks.used[i]);
      text += ']';
    } else {
      fmt::format_to(to, R"(,"reason":"{}")", data::Name(tracks.reason[i]));
    }
    if (tracks.left_out[i] != 0) {
      text += ",\"left_out\":[";
      Names(tracks.left_out[i]);
      text += ']';
    }
    text += "}\n";
  }
}

void LiveJson::Notice(const measure::LiveNotice& notice) {
  ordered_json line = {
      {"type", "notice"},        {"t", notice.t},         {"kind", measure::Name(notice.kind)},
      {"begins", notice.begins}, {"since", notice.since}, {"words", notice.words}};
  const measure::Reconstructor& pass = *(*live_)->reconstructor();
  if (notice.camera >= 0) {
    line["camera"] = pass.layout().cameras[static_cast<std::size_t>(notice.camera)];
  }
  if (notice.mark >= 0) line["mark"] = pass.layout().marks[static_cast<std::size_t>(notice.mark)];
  if (notice.begins) line["remedy"] = RemedyOf(notice);
  Line(line);
}

void LiveJson::Looked(double t, const measure::HealthReport& report) {
  const measure::Reconstructor& pass = *(*live_)->reconstructor();
  ordered_json line = {{"type", "health"}, {"t", t}, {"vouched", !report.unvouched.any}};
  if (report.unvouched.any) {
    line["unvouched"] = measure::Describe(report.unvouched, pass.layout().cameras);
  }
  if (!report.unknown.empty()) line["unknown"] = report.unknown;
  const auto& distances = pass.options().health.distances;
  if (!distances.empty()) {
    line["distances"] = {
        {"words", measure::Describe(report.distances, distances, pass.layout().cameras)},
        {"kept", report.distances.kept}};
  }
  for (std::size_t c = 0; c < report.cameras.size(); ++c) {
    const auto& slices = report.cameras[c];
    const auto last = std::find_if(slices.rbegin(), slices.rend(), [](const auto& slice) {
      return std::isfinite(slice.offset_px);
    });
    ordered_json& camera = line["cameras"][pass.layout().cameras[c]];
    if (last == slices.rend()) continue;
    camera = {{"t", last->t},
              {"offset_px", last->offset_px},
              {"sigma_px", LiveOutputFinite(last->sigma_px)},
              {"gain", LiveOutputFinite(last->gain)},
              {"width_px", LiveOutputFinite(last->width_px)}};
  }
  line["scatter"] = measure::Describe(report.scatter, pass.layout().cameras, pass.layout().marks);
  for (const measure::Fault& fault : report.faults) {
    line["faults"].push_back(measure::Describe(fault, pass.layout().cameras));
  }
  Line(line);
}

void LiveJson::Views(double t, std::span<const measure::LiveView> views) {
  // A line for each camera: short enough for a pipe to take it whole.
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    std::string& text = out_->text();
    const auto to = std::back_inserter(text);
    fmt::format_to(to, R"({{"type":"view","t":{},"camera":{},"marks":{{)", t, cameras_[c]);
    for (std::size_t m = 0; m < marks_.size(); ++m) {
      const measure::LiveView& view = views[c * marks_.size() + m];
      fmt::format_to(to, R"({}{}:{{"lit":{},"seen":{})", m == 0 ? "" : ",", marks_[m], view.lit,
                     view.seen);
      if (std::isfinite(view.u_px)) fmt::format_to(to, R"(,"u_px":{})", view.u_px);
      if (view.width_px > 0.0) fmt::format_to(to, R"(,"width_px":{})", view.width_px);
      if (view.flux > 0.0) fmt::format_to(to, R"(,"flux":{})", view.flux);
      text += '}';
    }
    text += "}}\n";
  }
}

void LiveJson::End(const measure::Live& live, const Durations& latency, const std::string& why) {
  constexpr double kMs = 1e3;  // of a second
  const auto of = [](const Durations& d, double scale) -> ordered_json {
    return {{"median", scale * d.Quantile(0.5)},
            {"p99", scale * d.Quantile(0.99)},
            {"most", scale * d.most()}};
  };
  ordered_json line = {{"type", "end"}, {"whole", why.empty()}, {"lines", live.lines()}};
  if (!why.empty()) line["why"] = why;
  if (const measure::Reconstructor* pass = live.reconstructor()) {
    line["samples"] = pass->summary().samples();
    line["usable"] = pass->summary().usable();
    const std::string exchanged = Describe(pass->summary().exchanged, pass->summary().marks);
    if (!exchanged.empty()) line["exchanged_marks"] = exchanged;
    for (const std::string& mark : pass->summary().LostMarks()) line["lost_marks"].push_back(mark);
  }
  line["latency_ms"] = of(latency, kMs);
  line["waited_s"] = of(window_, 1.0);
  Line(line);
}

std::string RemedyOf(const measure::LiveNotice& notice) {
  using measure::NoticeKind;
  switch (notice.kind) {
    case NoticeKind::kNoLight:
      return "look at the strobe, its supply, and whether the recorder's slots are right";
    case NoticeKind::kLed:
      return "look at its LED and cable, and whether it is in any camera's field";
    case NoticeKind::kCamera:
      return "look at its cap, what stands before it, its cable and where it points";
    case NoticeKind::kBlocked:
      return "clear what stands between them";
    case NoticeKind::kAim:
      return "turn the camera there and calibrate again, or move the mark";
    case NoticeKind::kLeftOut:
      return "look for a reflection or another light in its view, and whether it was bumped";
    case NoticeKind::kNoPosition:
      return "see which cameras see it, and whether one has moved";
    case NoticeKind::kMoved:
      return "it is left out from now on; fix it and calibrate again";
    case NoticeKind::kScatter:
      return "error bars are widened from now on; look for what shakes or blurs";
  }
  return {};
}

}  // namespace unfurl::cli
