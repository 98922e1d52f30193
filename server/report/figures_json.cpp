#include "server/report/figures_json.h"

#include "server/base/units.h"

namespace trammel {

nlohmann::ordered_json figures_json(const ErrorFigures& figures) {
  nlohmann::ordered_json axes;
  for (int k = 0; k < 3; ++k) {
    axes[std::string(1, "xyz"[k])] = {{"mean_mm", to_mm(figures.axis_mean(k))},
                                      {"std_mm", to_mm(figures.axis_stddev(k))}};
  }
  return {{"rms_mm", to_mm(figures.rms)},
          {"mean_mm", to_mm(figures.mean)},
          {"p997_mm", to_mm(figures.p997)},
          {"max_mm", to_mm(figures.max)},
          {"axis", axes}};
}

nlohmann::ordered_json length_json(const std::optional<double>& length) {
  return length ? nlohmann::ordered_json(to_mm(*length)) : nlohmann::ordered_json(nullptr);
}

}  // namespace trammel
