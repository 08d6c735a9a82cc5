#include "tests/cli/small_jobs.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "base/error.h"
#include "data/h5.h"
#include "data/h5_walk.h"
#include "tests/source_dir.h"

namespace unfurl::cli {

namespace {

// x = a sin(3 t), as a program that is fitted; it starts sooner than one in Python, and would write
// decimal commas where they are in force.
constexpr char kModel[] =
    "{ gsub(/[^0-9.e+-]/, \" \"); a += $1 }  # of parameters.json\n"
    "END {\n"
    "  print \"mark,t [s],x [m],y [m],vx [m/s],vy [m/s]\" > \"tracks.csv\"\n"
    "  for (i = 0; i <= 200; ++i) {\n"
    "    t = 0.01 * i\n"
    "    printf \"m,%.17g,%.17g,0,%.17g,0\\n\", t, a * sin(3 * t), 3 * a * cos(3 * t) > "
    "\"tracks.csv\"\n"
    "  }\n"
    "}\n";

std::string Tracks() {
  std::string text =
      "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz [m^2]\n";
  for (int i = 1; i < 80; ++i) {
    const double t = 0.02 * i, error = 1e-4 * std::sin(1e3 * i * i);
    text +=
        fmt::format("{},m,{},{},0,1e-8,0,0,1e-8,0,1e-8\n", t, 0.7 * std::sin(3 * t) + error, error);
  }
  return text;
}

}  // namespace

Outcome SmallJobsTest::Good(const std::vector<std::string>& command) const {
  Outcome outcome = Run(command);
  EXPECT_TRUE(outcome.code == 0 || outcome.code == 1) << command[0] << outcome.err;
  return outcome;
}

void SmallJobsTest::SetUp() {
  ProgramTest::SetUp();
  const std::string sets = UNFURL_SOURCE_DIR "/data/sets/";
  const std::string latch = sets + "bouncing_latch/scene.toml", lab = Shipped("lab.toml"),
                    rig = Shipped("rig.h5");
  std::filesystem::copy_file(UNFURL_SOURCE_DIR "/tests/fuzz/corpus/survey.csv",
                             folder_ / "survey.csv");
  Good({"simulate", Shipped("scene_suspension_4.toml"), "--duration", "0.02", "-o", "run.h5",
        "--quiet"});
  Good({"expose", "run.h5", "--lab", lab, "-o", "trial.h5", "--quiet"});
  Put("tracks.csv", Tracks());
  Put("model.awk", kModel);
  // The clock and the frame are known: half a swing is another's, turned and later.
  Put("study.toml",
      "[study]\nname = 'sine'\n[trial]\ntracks = 'tracks.csv'\noffset = 0.0\nframe = 'known'\n"
      "[model]\ncommand = ['env', 'LC_ALL=C', 'LD_PRELOAD=', 'awk', '-f', '{study}/model.awk', "
      "'parameters.json']\n"
      "[parameter.a]\nstart = 0.6\nbounds = [0.2, 2.0]\n");
  Put("block.toml",
      "[scene]\nname = 'block'\nduration = 1.0\n[body.block]\nmass = 2.0\ninertia = 0.1\n"
      "velocity = [0.7, 0, 0]\n");
  Put("plan.toml",
      "[campaign]\nruns = 6\n[job]\nscene = 'block.toml'\n[variable.v]\n"
      "keys = ['body.block.velocity[0]']\nuniform = [0.2, 1.0]\n[response.x]\n"
      "quantity = 'block.x'\nof = 'final'\n");
  jobs_ = {
      {{"simulate", Shipped("scene_suspension_4.toml"), "--duration", "0.1", "-o", "out.h5"},
       "out.h5"},
      {{"modes", latch, "-o", "out.h5"}, "out.h5"},
      {{"modes", latch, "--report", "out.html"}, "out.html"},
      {{"expose", "run.h5", "--lab", lab, "-o", "out.h5"}, "out.h5"},
      {{"expose", "--survey", Shipped("points.csv"), "--lab", lab, "-o", "out.h5"}, "out.h5"},
      {{"plan", rig, "--columns", "3", "--report", "out.html"}, "out.html"},
      {{"calibrate", "survey.csv", "--order", "pinhole", "--folds", "2", "-o", "out.h5"}, "out.h5"},
      {{"check", rig, Shipped("survey.h5"), "--report", "out.html"}, "out.html"},
      {{"reconstruct", "trial.h5", "--rig", rig, "-o", "out.h5"}, "out.h5"},
      {{"correlate", "run.h5", "run.h5", "--report", "out.html"}, "out.html"},
      {{"fit", "study.toml", "--allow-programs", "-o", "out.h5"}, "out.h5"},
      {{"cost", latch, "--duration", "0.05", "--rtol", "1e-3", "--rtol", "1e-4", "--report",
        "out.html"},
       "out.html"},
      {{"effects", latch, "--duration", "0.05", "--sigma", "1mm", "-o", "out.toml"}, "out.toml"},
      {{"design", "study.toml", "--allow-programs", "--report", "out.html"}, "out.html"},
      {{"campaign", "plan.toml", "--workers", "2", "-o", "out.h5"}, "out.h5"},
      {{"convert", "run.h5", "out.csv"}, "out.csv"},
      {{"convert", "tracks.csv", "out.c3d"}, "out.c3d"}};
  if (const char* verb = std::getenv("UNFURL_JOB")) {
    std::erase_if(jobs_, [&](const SmallJob& job) { return job.command[0] != verb; });
  }
  for (SmallJob& job : jobs_) {
    job.command.push_back("--quiet");
    job.tells_times = job.command[0] == "cost";
  }
}

std::string SmallJobsTest::Undisturbed(const SmallJob& job) const {
  Good(job.command);
  std::string bytes = Get(job.output);
  EXPECT_FALSE(bytes.empty()) << job.name();
  std::filesystem::remove(folder_ / job.output);
  return bytes;
}

std::string ContentsOf(const std::string& path) {
  if (!path.ends_with(".h5") && !path.ends_with(".partial")) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }
  const data::H5Reader file(path, data::H5Reader::SchemaOf(path), 1 << 30);
  std::string all = fmt::format("{} ", file.schema_version());
  const auto attributes = [&](const std::string& object) {
    for (const auto& [name, value] : file.Attributes(object)) {
      if (name != "command") all += name + "=" + value + ";";
    }
  };
  attributes("/");
  for (const std::string& set : data::H5ListDatasets(path)) {
    all += set;
    attributes(set);
    for (const std::size_t d : file.Dims(set)) all += fmt::format(" {}", d);
    try {
      const std::vector<double> values = file.ReadDoubles(set);
      all.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
    } catch (const Error&) {  // not numbers
      for (const std::string& text : file.ReadStrings(set)) all += text + ";";
    }
  }
  return all;
}

}  // namespace unfurl::cli
