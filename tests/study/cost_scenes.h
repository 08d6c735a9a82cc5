// Scenes on which `unfurl cost` is held to the truth: six that ship, six that do not.
#pragma once

#include <string>
#include <vector>

namespace unfurl::study {

struct CostScene {
  const char* name;
  const char* shipped;  // below data/sets; else
  const char* text;
  double duration;  // [s]
  int finest;       // segments of a truth that takes some seconds
  std::vector<std::string> quantities;
};

inline std::vector<CostScene> CostScenes() {
  return {
      {"cantilever", "cantilever/scene.toml", "", 0.3, 96, {}},
      {"flexible pendulum", "flexible_pendulum/scene.toml", "", 0.6, 64, {}},
      {"slider-crank", "slider_crank/scene.toml", "", 0.0, 48, {}},
      {"double pendulum", "double_pendulum/scene.toml", "", 1.0, 48, {}},
      {"deployment", "deployment/scene_suspension_4.toml", "", 1.2, 40, {}},
      {"Andrews", "andrews/scene.toml", "", 0.0, 48, {}},
      {"mast on a spring",
       "",
       "[scene]\nname = 'mast'\nduration = 1.0\n"
       "[beam.mast]\nlength = 2.4\nmass = 1.7\nEI = 35.0\ndamping = 1e-3\nsegments = 6\n"
       "[body.head]\nmass = 0.4\ninertia = 0.01\n"
       "[weld.top]\ninner = 'mast.end'\nouter = 'head'\n"
       "[joint.foot]\ninner = 'ground'\nouter = 'mast.start'\ntheta = 0.5\n"
       "[joint.foot.spring]\nstiffness = 60.0\n"
       "[mark.head_mark]\non = 'head'\n",
       0.0,
       48,
       {}},
      {"two panels, one latch",
       "",
       "[scene]\nname = 'panels'\nduration = 0.9\n"
       "[contact.stop]\nlaw = 'hunt_crossley'\nK = 2e7\nalpha = 0.3\n"
       "[beam.a]\nlength = 0.6\nmass = 0.5\nEI = 8.0\ndamping = 4e-4\nsegments = 4\n"
       "[beam.b]\nlength = 0.9\nmass = 0.3\nEI = 5.0\ndamping = 4e-4\nsegments = 6\n"
       "[joint.root]\ninner = 'ground'\nouter = 'a.start'\n"
       "[joint.root.spring]\nstiffness = 40.0\n"
       "[joint.hinge]\ninner = 'a.end'\nouter = 'b.start'\ntheta = 0.8\nsign = -1\n"
       "[joint.hinge.spring]\nstiffness = 1.5\npreload = 0.3\n"
       "[joint.hinge.damper]\ndamping = 0.05\n"
       "[joint.hinge.latch]\ntheta_a = 0.01\ntheta_b = 0.01\nlever = 0.04\ncontact = 'stop'\n"
       "[mark.tip]\non = 'b.end'\n",
       0.0,
       48,
       {"tip", "root.theta", "hinge.theta", "hinge.latch_time", "hinge.latch_rate"}},
      {"boom on a free hub",
       "",
       "[scene]\nname = 'boom'\nduration = 3.0\n"
       "[body.hub]\nmass = 30.0\ninertia = 4.0\nvelocity = [0.0, 0.0, 0.6]\n"
       "[beam.boom]\nlength = 3.5\nmass = 2.0\nEI = 60.0\nsegments = 8\n"
       "[weld.root]\ninner = 'hub'\nouter = 'boom.start'\n"
       "[body.tip]\nmass = 0.7\ninertia = 0.02\n[weld.end]\ninner = 'boom.end'\nouter = 'tip'\n"
       "[force.jet]\non = 'hub'\ntorque = {t = [0.0, 0.5, 1.0], value = [0.0, 2.0, 0.0]}\n"
       "[mark.tip_mark]\non = 'tip'\n[mark.middle]\non = 'boom'\nat = 0.5\n",
       0.0,
       48,
       {"tip_mark", "middle", "hub.theta", "boom.tip_deflection"}},
      {"rope that stretches",
       "",
       "[scene]\nname = 'rope'\nduration = 0.5\n"
       "[beam.rope]\nlength = 1.5\nmass = 0.6\nEI = 4.0\naxial = 'elastic'\nEA = 3e4\n"
       "damping = 1e-4\nsegments = 6\n"
       "[joint.hook]\ninner = 'ground'\nouter = 'rope.start'\ntheta = -0.4\n"
       "[gravity]\nacceleration = [0.0, -3.7]\n[mark.end]\non = 'rope.end'\n",
       0.0,
       48,
       {}},
      {"rigid gate with a drag and a table",
       "",
       "[scene]\nname = 'gate'\nduration = 2.5\n"
       "[body.leaf]\nmass = 12.0\ninertia = 3.0\n"
       "[body.flap]\nmass = 2.0\ninertia = 0.2\n"
       "[joint.post]\ninner = 'ground'\nouter = 'leaf'\nouter_point = [-1.1, 0.0]\ntheta = 1.2\n"
       "[joint.post.spring]\nstiffness = 9.0\n[joint.post.quadratic_damper]\ndamping = 1.5\n"
       "[joint.post.latch]\ntheta_a = 0.02\ntheta_b = 0.02\nlever = 0.2\ncontact = 'catch'\n"
       "[contact.catch]\nK = 1e6\nC = 800.0\nQ = 3.0\nepsilon = 1e-5\n"
       "[joint.edge]\ninner = 'leaf'\ninner_point = [1.1, 0.0]\nouter = 'flap'\n"
       "outer_point = [-0.5, 0.0]\ntheta = 0.3\n"
       "[joint.edge.table]\ntheta = [-1.0, -0.2, 0.2, 1.0]\nmoment = [3.0, 0.2, -0.2, -3.0]\n"
       "[mark.corner]\non = 'flap'\npoint = [0.5, 0.0]\n",
       0.0,
       48,
       {"corner", "post.theta", "edge.theta", "post.latch_time"}},
      {"portal frame",
       "",
       "[scene]\nname = 'portal'\nduration = 0.25\n"
       "[beam.left]\nlength = 1.0\nmass = 0.8\nEI = 90.0\nsegments = 6\n"
       "[beam.right]\nlength = 1.0\nmass = 0.8\nEI = 90.0\nsegments = 6\n"
       "[body.roof]\nmass = 3.0\ninertia = 0.6\n"
       "[weld.l]\ninner = 'ground'\nouter = 'left.start'\nangle = 1.5707963267948966\n"
       "[weld.r]\ninner = 'ground'\ninner_point = [1.2, 0.0]\nouter = 'right.start'\n"
       "angle = 1.5707963267948966\n"
       "[joint.pl]\ninner = 'left.end'\nouter = 'roof'\nouter_point = [-0.6, 0.0]\n"
       "theta = -1.5707963267948966\n"
       "[joint.pr]\ninner = 'right.end'\nouter = 'roof'\nouter_point = [0.6, 0.0]\n"
       "theta = -1.5707963267948966\n"
       "[force.push]\non = 'roof'\nforce = ['40 * sin(20 * t)', 0.0]\n"
       "[mark.corner]\non = 'roof'\npoint = [0.6, 0.0]\n",
       0.0,
       48,
       {"corner", "pl.theta", "left.tip_deflection"}},
  };
}

}  // namespace unfurl::study
