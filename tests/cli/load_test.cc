// Large jobs: 1e7 lines, 10,000 surveyed points, a day of four marks. Each runs at a part of the
// size first; what is found is printed: processor time by item, which stays where time is linear,
// and peak memory, which is also held against a bound. UNFURL_LOAD=0.01 tries it at a hundredth.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <cstdlib>
#include <fstream>

#include "base/random.h"
#include "data/run.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "tests/cli/program.h"

namespace unfurl::cli::load_test {
namespace {

double CpuOfChildren() {
  rusage usage = {};
  getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

class Load : public ProgramTest {
 protected:
  // The size, or the part of it that UNFURL_LOAD names.
  static std::size_t Size(double whole) {
    const char* part = std::getenv("UNFURL_LOAD");
    return static_cast<std::size_t>(std::lround(whole * (part != nullptr ? std::atof(part) : 1.0)));
  }

  // Runs it, prints what it took, and gives the peak of memory [kB].
  long Measure(const std::vector<std::string>& command, std::size_t items,
               const std::string& what) const {
    const double before = CpuOfChildren();
    const Outcome outcome = Run(command);
    const double seconds = CpuOfChildren() - before;
    EXPECT_LE(outcome.code, 1) << outcome.err;
    std::printf("found: %s, %zu %s: %.1f s of processor, %.2f us each; peak memory %ld MB\n",
                command[0].c_str(), items, what.c_str(), seconds,
                1e6 * seconds / static_cast<double>(items), outcome.peak_kb / 1024);
    std::fflush(stdout);
    return outcome.peak_kb;
  }

  void Good(const std::vector<std::string>& command) const {
    const Outcome outcome = Run(command);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
  }

  static data::RunLayout Layout() {
    data::RunLayout layout;
    layout.marks = {"mark1", "mark1b", "mark2", "mark3"};
    for (const std::string& mark : layout.marks) {
      for (const char* axis : {".x", ".y", ".vx", ".vy"}) {
        layout.quantities.push_back({mark + axis, axis[1] == 'v' ? "m/s" : "m", ""});
      }
    }
    return layout;
  }
};

// Sensors of 256 pixels instead of 2160, so that 1e7 lines of four cameras find room on a disk. The
// recorder's files are those of 20 s, named again and again; what moves comes back to its place
// after them.
class LoadOfLines : public Load {
 protected:
  static constexpr double kPeriod = 20.0;  // s

  void SetUp() override {
    Load::SetUp();
    Put("lab.toml", "include = ['" + Shipped("lab.toml") +
                        "']\n[sensor]\ndummy = 0\ndark = 16\nactive = 256\ndark_after = 0\n"
                        "parity = 0\npitch = 118e-6\nblur = 100e-6\n"
                        "[strobe]\nlead = [0.01, 0.02]\n");
    Good({"expose", "--survey", Shipped("points.csv"), "--lab", "lab.toml", "-o", "survey.h5"});
    Good({"calibrate", "survey.h5", "-o", "rig.h5"});
    {
      data::RunWriter writer((folder_ / "run.h5").string(), {}, Layout());
      for (int i = 0; i <= 20200; ++i) {
        const double t = 1e-3 * i, w = 2.0 * M_PI / kPeriod;
        std::vector<double> values;
        for (int m = 0; m < 4; ++m) {
          const double at = w * t + m;
          values.insert(values.end(), {0.8 + 0.2 * m * std::sin(at), 0.3 + 0.2 * std::cos(at),
                                       0.2 * m * w * std::cos(at), -0.2 * w * std::sin(at)});
        }
        writer.Append(t, values);
      }
      writer.Commit();
    }
    Good({"expose", "run.h5", "--lab", "lab.toml", "-o", "short.h5"});
    PutRaw();
  }

  void PutRaw() {
    const data::TrialReader reader((folder_ / "short.h5").string());
    header_ = reader.header();
    data::TrialBlock block;
    reader.Read(0, std::lround(kPeriod * header_.line_rate), &block);
    first_slot_ = block.slot[0];
    for (std::size_t c = 0; c < header_.cameras.size(); ++c) {
      std::ofstream raw(folder_ / (header_.cameras[c] + ".raw"), std::ios::binary);
      for (std::size_t i = 0; i < block.size(); ++i) {
        const auto line = block.Line(header_, i, c);
        raw.write(reinterpret_cast<const char*>(line.data()),
                  static_cast<std::streamsize>(line.size_bytes()));
      }
    }
    lines_of_raw_ = block.size();
  }

  std::size_t PutDescription(const std::string& name, std::size_t lines) const {
    const std::size_t laps = std::max<std::size_t>(1, lines / lines_of_raw_);
    std::string text = fmt::format(
        "[sensor]\ndummy = 0\ndark = 16\nactive = 256\ndark_after = 0\nparity = 0\n"
        "pitch = 118e-6\nbits = 12\nelectrons_per_count = 14.6\nread_noise_counts = 2.4\n"
        "[recording]\nformat = 'binary'\nbyte_order = 'little'\nline_rate = {}\nfirst_slot = {}\n"
        "slots = ['{}']\n",
        header_.line_rate, first_slot_, fmt::join(header_.slots, "', '"));
    for (const std::string& camera : header_.cameras) {
      text += fmt::format("[camera.{}]\nfiles = [", camera);
      for (std::size_t lap = 0; lap < laps; ++lap) text += fmt::format("'{}.raw', ", camera);
      text += "]\n";
    }
    Put(name, text);
    return laps * lines_of_raw_;
  }

  data::TrialHeader header_;
  int first_slot_ = 0;
  std::size_t lines_of_raw_ = 0;
};

TEST_F(LoadOfLines, ConvertAndReconstruct) {
  // HDF5's index of chunks, up to the size of its cache; the description's names of files.
  constexpr long kMostKb = 20000;
  long convert[2] = {}, reconstruct[2] = {};
  for (const int whole : {0, 1}) {
    const std::size_t lines = PutDescription("lines.toml", Size(whole != 0 ? 1e7 : 1e6));
    convert[whole] = Measure({"convert", "lines.toml", "trial.h5"}, lines, "lines");
    reconstruct[whole] =
        Measure({"reconstruct", "trial.h5", "--rig", "rig.h5", "-o", "tracks.h5", "--workers", "2"},
                lines, "lines");
    const auto size = [&](const char* name) {
      return static_cast<double>(std::filesystem::file_size(folder_ / name)) / 1e9;
    };
    std::printf("found: trial %.2f GB, tracks %.2f GB\n", size("trial.h5"), size("tracks.h5"));
  }
  EXPECT_LT(convert[1] - convert[0], kMostKb);
  EXPECT_LT(reconstruct[1] - reconstruct[0], kMostKb);
}

TEST_F(Load, SurveyPoints) {
  Rng rng(3);
  const std::size_t all = Size(10000);
  Put("moved.toml", "include = ['" + Shipped("lab.toml") + "']\n[mounting]\nposition = 6e-3\n");
  for (const std::size_t points : {all / 4, all}) {
    std::string text = "id,x [m],y [m],z [m],sx [m],sy [m],sz [m]\n";
    for (std::size_t i = 0; i < points; ++i) {
      text += fmt::format("P{},{:.6f},{:.6f},{:.6f},3e-4,3e-4,3e-4\n", i, rng.Uniform(-1.1, 1.1),
                          rng.Uniform(-1.1, 1.1), rng.Uniform(-1.1, 1.1));
    }
    Put("points.csv", text);
    Measure({"expose", "--survey", "points.csv", "--lab", Shipped("lab.toml"), "-o", "survey.h5"},
            points, "points");
    Measure({"calibrate", "survey.h5", "-o", "rig.h5", "--report", "page.html"}, points, "points");
    Measure({"check", "rig.h5", "survey.h5", "--report", "check.html"}, points, "points");
    // Cameras that moved, so that all causes are weighed, three times, and each is tried without.
    Good({"expose", "--survey", "points.csv", "--lab", "moved.toml", "-o", "moved.h5"});
    Measure({"check", "rig.h5", "moved.h5", "--report", "check.html"}, points, "points, moved");
    Measure({"plan", "rig.h5", "--points", std::to_string(points)}, points, "points");
  }
}

// 10 samples a second of each mark: a drift in a day's rhythm, and three modes that wind keeps
// going.
TEST_F(Load, DayOfFourMarks) {
  constexpr double kRate = 10.0;
  for (const double hours : {6.0, 24.0}) {
    const std::size_t n = Size(hours * 3600.0 * kRate);
    data::Tracks tracks;
    tracks.frame = "model";
    data::RunLayout layout = Layout();
    tracks.marks = layout.marks;
    Rng rng(11);
    {
      data::RunWriter writer((folder_ / "run.h5").string(), {}, layout);
      const double f[3] = {0.31, 0.83, 1.97};  // Hz
      double a[3] = {}, b[3] = {};
      const double keep = std::exp(-0.01);
      const auto at = [&](double t, int m, double* xy) {
        xy[0] = 0.5 * m + 2e-3 * std::sin(2.0 * M_PI * t / 86400.0 + m);
        xy[1] = 0.3 * std::cos(1.0 + m);
        for (int k = 0; k < 3; ++k) {
          const double phase = 2.0 * M_PI * f[k] * t;
          const double q = a[k] * std::cos(phase) + b[k] * std::sin(phase);
          xy[0] += q * std::cos(m + k), xy[1] += q * std::sin(m + k);
        }
      };
      std::vector<double> values(16);
      for (std::size_t i = 0; i < n; ++i) {
        for (int k = 0; k < 3; ++k) {
          a[k] = keep * a[k] + 1e-3 * rng.Normal(), b[k] = keep * b[k] + 1e-3 * rng.Normal();
        }
        const double t = static_cast<double>(i) / kRate;
        for (int m = 0; m < 4; ++m) {
          double now[2], later[2];
          at(t, m, now), at(t + 1e-4, m, later);
          values[4 * m] = now[0], values[4 * m + 1] = now[1];
          values[4 * m + 2] = (later[0] - now[0]) / 1e-4;
          values[4 * m + 3] = (later[1] - now[1]) / 1e-4;
        }
        writer.Append(t, values);
        for (int m = 0; m < 4; ++m) {
          tracks.t.push_back(t + 0.02 * m);
          tracks.mark.push_back(m);
        }
      }
      writer.Commit();
    }
    // Between the run's samples by its own positions and speeds, and noise of 0.1 mm.
    const data::Run run = data::ReadRun((folder_ / "run.h5").string());
    const auto count = static_cast<Eigen::Index>(tracks.t.size());
    tracks.p.setZero(3, count);
    tracks.cov.setZero(6, count);
    tracks.cov.row(0).setConstant(1e-8), tracks.cov.row(3).setConstant(1e-8);
    tracks.cov.row(5).setConstant(1e-8);
    tracks.status.assign(tracks.t.size(), data::SampleStatus::kGood);
    const char* axes[2] = {".x", ".y"};
    for (int m = 0; m < 4; ++m) {
      for (int axis = 0; axis < 2; ++axis) {
        const auto& p = run.Column(layout.marks[m] + axes[axis]);
        const auto& v = run.Column(layout.marks[m] + ".v" + (axes[axis] + 1));
        for (std::size_t i = 0; i < n; ++i) {
          tracks.p(axis, static_cast<Eigen::Index>(4 * i + m)) = p[i] + 0.02 * m * v[i];
        }
      }
    }
    for (Eigen::Index i = 0; i < count; ++i) {
      for (int axis = 0; axis < 3; ++axis) tracks.p(axis, i) += 1e-4 * rng.Normal();
    }
    data::WriteTracks((folder_ / "tracks.h5").string(), tracks, {});
    Measure({"correlate", "tracks.h5", "run.h5", "-o", "numbers.json"}, 4 * n, "samples");
    Measure({"correlate", "tracks.h5", "run.h5", "-o", "numbers.json", "--report", "page.html"},
            4 * n, "samples, with a page");
  }
}

}  // namespace
}  // namespace unfurl::cli::load_test
