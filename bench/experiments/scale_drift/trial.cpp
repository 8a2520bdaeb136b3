#include "experiments/scale_drift/trial.hpp"

namespace twofold::bench {

DriftTrial run_trial(const Scene& scene, double noise_px, unsigned seed,
                     const std::vector<LoopSearch>& searches) {
  DriftTrial trial;
  trial.truth = camera_centres(scene.T_c_w);
  const ExplorationOptions options;
  const auto map =
      explore(scene.rig, measure(scene, noise_px, seed), scene.T_c_w[0], scene.T_c_w[1], options);
  if (!map) return trial;
  for (const LoopSearch& search : searches) {
    const auto loop = close_loop(scene.rig, *map, search.i_begin, search.i_end, search.j);
    if (!loop) return trial;
    trial.loops.push_back(*loop);
  }
  trial.centres[kExplored] = camera_centres(map->T_c_w);
  trial.centres[kSe3] = corrected_centres<SE3>(*map, trial.loops);
  trial.centres[kSim3] = corrected_centres<Sim3>(*map, trial.loops);
  for (const Method m : {kExplored, kSe3, kSim3}) {
    trial.rmse[m] = scaled_rmse(trial.truth, trial.centres[m], trial.truth[0]);
    trial.rmse_centre[m] = scaled_rmse(trial.truth, trial.centres[m], Vector3::Zero());
  }
  trial.ok = true;
  return trial;
}

}  // namespace twofold::bench
