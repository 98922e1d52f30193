// Shows the real place of a model's robot, and the command that would correct it: offline MODEL
#include "trammel/offline.h"

#include <cmath>
#include <cstdio>
#include <vector>

using namespace trammel::api;

int main(int count, char** arguments) {
  const Result<Model> model = Model::load(count > 1 ? arguments[1] : "cell.model");
  if (!model) return std::puts(model.error().sentence.c_str()), 3;

  // One pose, all joints at zero; 0 is a seed of the branch as well.
  const std::vector<double> joints_deg(model->cell().joints(), 0.0);
  const auto predicted = model->predict(joints_deg);
  if (!predicted) return std::puts(predicted.error().sentence.c_str()), 3;
  const Prediction& p = predicted->front();
  std::printf("error in B: %.3f %.3f %.3f mm, %s\n", p.error_mm[0], p.error_mm[1], p.error_mm[2],
              p.in_domain ? "in domain" : "out of domain");
  std::printf("standard deviations: %.3f %.3f %.3f mm\n", std::sqrt(p.covariance_mm2[0]),
              std::sqrt(p.covariance_mm2[4]), std::sqrt(p.covariance_mm2[8]));

  const Target wanted{.pose = p.nominal, .joints_deg = joints_deg, .conf = {}};
  const auto corrected = model->correct(std::vector<Target>{wanted});
  if (!corrected) return std::puts(corrected.error().sentence.c_str()), 3;
  const CorrectedTarget& target = corrected->front();
  std::printf("%s: command x %.3f mm; expect %.3f mm instead of %.3f mm\n", target.status.c_str(),
              target.commanded.xyz_mm[0], target.error_after_mm, target.error_before_mm);
}
