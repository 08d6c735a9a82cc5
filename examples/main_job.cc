// From a survey and a recorded trial to the parameters of the structure, as the program does it:
//   main_job survey.h5 trial.h5 study.toml
#include <unfurl/unfurl.h>

#include <cstdio>

using namespace unfurl;

int main(int, char** argv) try {
  const calib::Calibration rig = calib::Calibrate(data::ReadSurvey(argv[1]));
  data::WriteTracks("tracks.h5", measure::Reconstruct(data::TrialReader(argv[2]), rig.rig), {});
  const study::StudyFit fit =
      study::Fit(data::ReadStudy(argv[3]), {.tracks = "tracks.h5", .output = "fit.h5"});
  for (const auto& p : fit.record.parameters) {
    std::printf("%s = %.6g +- %.2g %s\n", p.name.c_str(), p.value, p.sigma, p.unit.c_str());
  }
  return fit.Usable() ? 0 : 1;
} catch (const Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
