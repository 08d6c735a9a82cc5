#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scenes.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim {

// A run with all that is sampled, and how far its energy balance is off.
struct Sampled : Observer {
  explicit Sampled(const Model& model) : observables(model) {}
  void OnSample(double time, double* y, const std::vector<LatchMode>& modes) override {
    t.push_back(time);
    rows.push_back(observables.Row(time, y, modes));
    const Balance& b = observables.balance();
    residual = std::max(residual, std::fabs(b.Conserved() - observables.energy_at_start()));
  }
  std::vector<double> operator[](const std::string& column) const {
    std::vector<double> values;
    const auto& names = observables.quantities();
    for (std::size_t k = 0; k < names.size(); ++k) {
      if (names[k].name != column) continue;
      for (const auto& row : rows) values.push_back(row[k]);
    }
    EXPECT_FALSE(values.empty()) << "no column " << column;
    return values;
  }
  Observables observables;
  std::vector<double> t;
  std::vector<std::vector<double>> rows;
  double residual = 0.0;  // [J]
};

inline constexpr double kTight = 1e-11;  // rtol of the runs that are held to a closed form

inline void RunTight(const Model& model, double duration, Sampled* sampled) {
  SimulateOptions options;
  options.rtol = kTight;
  options.duration = duration;
  options.rate = 200.0;
  const SimulateReport report = Simulate(model, options, sampled);
  EXPECT_TRUE(report.Usable()) << report.message;
}

// A wheel on a pin at the origin; inertia 0.5 about it.
inline std::string WheelScene(const std::string& more) {
  return "[scene]\nname = 'wheel'\nduration = 2.0\n"
         "[body.wheel]\nmass = 3.0\ninertia = 0.5\n"
         "[joint.axle]\ninner = 'ground'\nouter = 'wheel'\n" +
         more;
}
// A block of 2 kg on a slide along x.
inline std::string BlockScene(const std::string& more) {
  return "[scene]\nname = 'block'\nduration = 2.0\n"
         "[body.block]\nmass = 2.0\ninertia = 0.1\n"
         "[joint.slide]\ntype = 'slider'\ninner = 'ground'\nouter = 'block'\n" +
         more;
}
// A body free in the plane; 2 kg, 0.5 kg m^2.
inline std::string FreeScene(const std::string& more) {
  return "[scene]\nname = 'free'\nduration = 2.0\n"
         "[body.box]\nmass = 2.0\ninertia = 0.5\n" +
         more;
}

// Every effect of this room at once: a bar on a pin and a block on a slide in it, a beam welded to
// the bar.
inline std::string EverythingScene() {
  return "[scene]\nname = 'everything'\nduration = 1.0\n"
         "[body.bar]\nmass = 2.0\ninertia = 0.1\n"
         "[body.block]\nmass = 0.5\ninertia = 0.01\n"
         "[beam.rod]\nlength = 0.6\nmass = 0.3\nEI = 3.0\nsegments = 4\ndamping = 1e-4\n"
         "[weld.root]\ninner = 'bar'\ninner_point = [0.4, 0.0]\nouter = 'rod.start'\nangle = 0.3\n"
         "[joint.pivot]\ninner = 'ground'\nouter = 'bar'\nouter_point = [-0.4, 0.0]\ntheta = 0.7\n"
         "theta_rate = 1.0\n"
         "[joint.pivot.spring]\nstiffness = 3.0\npreload = 0.2\n"
         "[joint.pivot.damper]\ndamping = 0.05\n"
         "[joint.pivot.quadratic_damper]\ndamping = 0.08\n"
         "[joint.pivot.friction]\nmoment = 0.1\ncreep_rate = 0.05\n"
         "[joint.pivot.table]\ntheta = [-1.0, 0.0, 0.5, 2.0]\nmoment = [1.0, 0.2, 0.0, -2.0]\n"
         "[joint.pivot.motor]\nmoment = 'sin(20 * t)'\n"
         "[joint.slide]\ntype = 'slider'\ninner = 'bar'\ninner_point = [0.1, 0.05]\nouter = "
         "'block'\n"
         "axis = 0.4\ntravel = 0.1\ntravel_rate = -0.5\n"
         "[joint.slide.spring]\nstiffness = 40.0\nfree = 0.05\n"
         "[joint.slide.damper]\ndamping = 0.3\n"
         "[joint.slide.quadratic_damper]\ndamping = 0.6\n"
         "[joint.slide.table]\ntravel = [-0.2, 0.0, 0.3]\nforce = [3.0, 0.0, -1.0]\n"
         "[joint.slide.friction]\nforce = 0.2\ncreep_rate = 0.02\n"
         "[joint.slide.motor]\nforce = {t = [0, 0.3, 1], value = [0, 1, -1]}\n"
         "[spring.tie]\na = 'ground'\na_point = [0.5, 0.8]\nb = 'rod.end'\nstiffness = 20.0\n"
         "damping = 0.4\nfree_length = 0.3\n"
         "[spring.stay]\na = 'bar'\na_point = [0.0, 0.3]\nb = 'rod'\nb_at = 0.5\nstiffness = 15.0\n"
         "[force.push]\non = 'bar'\npoint = [0.1, 0.2]\nforce = ['cos(9 * t)', 0.5]\nframe = "
         "'body'\n"
         "[force.pull]\non = 'rod'\nat = 0.25\nforce = [0.3, '1 - t']\n"
         "[force.turn]\non = 'rod.end'\ntorque = '0.1 * sin(7 * t)'\n"
         "[force.wind]\non = 'rod'\nper_length = ['0.2 * t', -0.3]\n"
         "[gravity]\nacceleration = [0.0, -9.81]\n";
}

}  // namespace unfurl::sim
