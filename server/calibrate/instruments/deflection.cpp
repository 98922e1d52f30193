#include "server/calibrate/instruments/deflection.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "server/base/coverage.h"
#include "server/base/units.h"

namespace trammel {

namespace {

constexpr double kSignificant =
    0.01;  // p-value: a beam is claimed wrongly in one of a hundred cases
constexpr double kSameLoad = 0.5e-3 + 1e-6;  // N: half the last of three decimals, and rounding
constexpr double kSeen =
    3;  // standard deviations: a bend at the link's end that would have been seen
constexpr double kLeastPivot = 1e-9;  // share of the largest: parameters with a smaller pivot are
                                      // not separated
constexpr std::size_t kFewestLoads =
    4;  // enough to hold some out, while the least and the largest load stay in the training
constexpr std::size_t kHeldOut =
    3;  // every third load is held out: Table 4.7 has the second and fifth of six

/// Force and moments of a load on an element, Figure 4.8.
struct Moments {
  double w = 0;         ///< N, across the link at its far end
  double end = 0;       ///< M, Nm
  double reaction = 0;  ///< M_R, Nm
};

Moments moments_of(const DeflectionElement& element, double load) {
  const double w = load * std::cos(element.theta);
  const double end = load * element.lever;
  return {w, end, end + w * element.length};
}

/// Deflection across the link per 1/EI, eq. (4.2), and its slope.
double beam(const DeflectionElement& element, const Moments& load, double x) {
  return load.w * x * x * (3 * element.length - x) / 6 + load.end * x * x / 2;
}
double beam_slope(const DeflectionElement& element, const Moments& load, double x) {
  return load.w * (element.length * x - x * x / 2) + load.end * x;
}

Eigen::Vector2d along(const DeflectionElement& element) {
  return {std::cos(element.theta), std::sin(element.theta)};
}
/// The motion of a point at `r` per radian of the joint's deflection, downward for a link that
/// points outward.
Eigen::Vector2d swung(const Eigen::Vector2d& r) { return {r.y(), -r.x()}; }

/// The columns of the linear model, with the first column of each element.
struct Layout {
  struct Columns {
    int compliance = 0, flexibility = -1, offset = 0, load_bias = -1;
  };
  std::vector<Columns> elements;
  int size = 0;
};

Layout layout_of(const DeflectionData& data, const std::set<int>& beams,
                 const std::set<int>& load_biases) {
  Layout layout;
  for (const DeflectionElement& element : data.elements) {
    Layout::Columns columns;
    columns.compliance = layout.size++;
    if (beams.contains(element.element)) columns.flexibility = layout.size++;
    columns.offset = layout.size;
    layout.size += 2;
    if (load_biases.contains(element.element)) {
      columns.load_bias = layout.size;
      layout.size += 2;
    }
    layout.elements.push_back(columns);
  }
  return layout;
}

/// 2 x parameters: dx, dz of one reading per unit of each parameter.
Eigen::MatrixXd rows_of(const DeflectionReading& reading, const DeflectionData& data,
                        const Layout& layout, bool chained) {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(2, layout.size);
  std::size_t own = 0;
  while (data.elements[own].element != reading.element) ++own;
  Eigen::Vector2d from_end = Eigen::Vector2d::Zero();  // from the end of element e to the reflector
  for (std::size_t e = own + 1; e-- > 0;) {
    const DeflectionElement& element = data.elements[e];
    const Layout::Columns& columns = layout.elements[e];
    const Moments load = moments_of(element, reading.load);
    const bool itself = e == own;
    if (!itself && !chained) break;
    const double x = itself ? reading.x : element.length;
    const Eigen::Vector2d across = swung(along(element));
    rows.col(columns.compliance) += load.reaction * (x * across + swung(from_end));
    if (columns.flexibility >= 0) {
      rows.col(columns.flexibility) += beam(element, load, x) * across;
      rows.col(columns.flexibility) += beam_slope(element, load, x) * swung(from_end);
    }
    if (itself) rows.middleCols<2>(columns.offset).setIdentity();
    if (columns.load_bias >= 0) {
      rows.middleCols<2>(columns.load_bias) = load.reaction * Eigen::Matrix2d::Identity();
    }
    from_end += x * along(element);
  }
  return rows;
}

struct Solved {
  Layout layout;
  Eigen::VectorXd values;
  Eigen::MatrixXd unscaled;  ///< covariance for residuals of the stated sigma
  double cost = 0;           ///< weighted sum of squares
  int equations = 0;

  [[nodiscard]] int freedom() const { return equations - layout.size; }
  [[nodiscard]] double factor() const { return cost / std::max(1, freedom()); }
  [[nodiscard]] double u(int column) const {
    return kExpanded * std::sqrt(unscaled(column, column) * std::max(1.0, factor()));
  }
};

double sigma_of(const DeflectionReading& reading, const DeflectionOptions& options) {
  return reading.sigma.value_or(options.sigma);
}

/// The weighted equations of all readings, A values = b.
struct Equations {
  Eigen::MatrixXd A;
  Eigen::VectorXd b;
};

Equations equations_of(const DeflectionData& data,
                       const std::vector<const DeflectionReading*>& readings,
                       const DeflectionOptions& options, const Layout& layout) {
  const auto rows = 2 * static_cast<Eigen::Index>(readings.size());
  Equations equations{Eigen::MatrixXd(rows, layout.size), Eigen::VectorXd(rows)};
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const auto row = 2 * static_cast<Eigen::Index>(k);
    const double inverse_sigma = 1 / sigma_of(*readings[k], options);
    equations.A.middleRows<2>(row) =
        inverse_sigma * rows_of(*readings[k], data, layout, options.chained);
    equations.b.segment<2>(row) = inverse_sigma * readings[k]->moved;
  }
  return equations;
}

Result<Solved> solve(const DeflectionData& data,
                     const std::vector<const DeflectionReading*>& readings,
                     const DeflectionOptions& options, const std::set<int>& beams,
                     const std::set<int>& load_biases) {
  Solved solved;
  solved.layout = layout_of(data, beams, load_biases);
  solved.equations = 2 * static_cast<int>(readings.size());
  const int size = solved.layout.size;
  if (solved.freedom() < 1) {
    return refused("{} training readings, {} parameters need at least {}", readings.size(), size,
                   size / 2 + 1)
        .in(data.where)
        .beyond(readings.size(), size / 2 + 1);
  }
  const auto [A, b] = equations_of(data, readings, options, solved.layout);
  const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = A * scale.cwiseInverse().asDiagonal();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(kLeastPivot);
  qr.compute(scaled);
  if (qr.rank() < size) {
    return refused("the readings separate {} of {} parameters", qr.rank(), size)
        .in(data.where)
        .beyond(qr.rank(), size)
        .next("more loads or reflectors at other distances would");
  }
  solved.values = qr.solve(b).cwiseQuotient(scale);
  solved.cost = (A * solved.values - b).squaredNorm();
  const Eigen::MatrixXd inverse =
      (scaled.transpose() * scaled).ldlt().solve(Eigen::MatrixXd::Identity(size, size));
  solved.unscaled = scale.cwiseInverse().asDiagonal() * inverse * scale.cwiseInverse().asDiagonal();
  return solved;
}

/// Two-sided p of Student's t, by the integral of cos^(freedom - 1) that it is.
double p_of_t(double t, int freedom) {
  constexpr int kSteps = 4000;  // even
  const auto tail = [&](double from) {
    const double step = (kPi / 2 - from) / kSteps;
    double sum = 0;
    for (int k = 0; k <= kSteps; ++k) {
      const double weight = k == 0 || k == kSteps ? 1 : (k % 2 == 1 ? 4 : 2);
      sum += weight * std::pow(std::max(0.0, std::cos(from + k * step)), freedom - 1);
    }
    return sum * step / 3;
  };
  return tail(std::atan(std::abs(t) / std::sqrt(freedom))) / tail(0);
}

/// p of an F with 2 and `freedom` degrees of freedom.
double p_of_f2(double f, int freedom) { return std::pow(1 + 2 * f / freedom, -freedom / 2.0); }

struct Split {
  std::vector<const DeflectionReading*> train, validation;
  std::vector<double> training_loads, validation_loads;
};

/// The loads that are held out for validation; empty if the file marks each reading.
Result<std::optional<std::set<double>>> held_out_loads(const DeflectionData& data,
                                                       const DeflectionOptions& options) {
  std::set<double> all;
  bool stated = false;
  for (const DeflectionReading& reading : data.readings) {
    all.insert(reading.load);
    stated = stated || reading.validation.has_value();
  }
  const std::vector<double> loads(all.begin(), all.end());
  std::set<double> held_out;
  for (const double wanted : options.validation_loads) {
    const auto found = std::find_if(loads.begin(), loads.end(), [&](double load) {
      return std::abs(load - wanted) < kSameLoad;
    });
    if (found == loads.end())
      return refused("no readings under the validation load {} N", wanted)
          .in(data.where)
          .of("load")
          .with_value(wanted);
    held_out.insert(*found);
  }
  if (!options.validation_loads.empty()) return held_out;
  if (stated) return std::nullopt;
  if (loads.size() < kFewestLoads) return held_out;
  for (std::size_t k = 1; k + 1 < loads.size(); k += kHeldOut) held_out.insert(loads[k]);
  return held_out;
}

Result<Split> split_of(const DeflectionData& data, const DeflectionOptions& options) {
  const std::optional<std::set<double>> by_load = TRY(held_out_loads(data, options));
  Split split;
  std::set<double> training, validation;
  for (const DeflectionReading& reading : data.readings) {
    const bool out = by_load ? by_load->contains(reading.load) : reading.validation.value_or(false);
    (out ? split.validation : split.train).push_back(&reading);
    (out ? validation : training).insert(reading.load);
  }
  if (training.size() < 2) {
    return refused("{} training loads, at least 2 are needed to tell a joint from an offset",
                   training.size())
        .in(data.where)
        .of("load")
        .beyond(training.size(), 2);
  }
  split.training_loads.assign(training.begin(), training.end());
  split.validation_loads.assign(validation.begin(), validation.end());
  return split;
}

/// rms of |dp| of `element`'s readings (0: of all). Nothing predicted when `solved` is null.
double rms_of(const std::vector<const DeflectionReading*>& readings, const DeflectionData& data,
              const Solved* solved, bool chained, int element) {
  double sum = 0;
  int count = 0;
  for (const DeflectionReading* reading : readings) {
    if (element != 0 && reading->element != element) continue;
    Eigen::Vector2d left = reading->moved;
    if (solved != nullptr)
      left -= rows_of(*reading, data, solved->layout, chained) * solved->values;
    sum += left.squaredNorm();
    ++count;
  }
  return count == 0 ? 0 : std::sqrt(sum / count);
}

DeflectionFit fit_of(const Solved& solved, std::size_t e, const DeflectionData& data,
                     const Split& split, bool chained) {
  const Layout::Columns& columns = solved.layout.elements[e];
  const int element = data.elements[e].element;
  DeflectionFit fit;
  fit.compliance = solved.values(columns.compliance);
  fit.compliance_u = solved.u(columns.compliance);
  if (columns.flexibility >= 0) {
    fit.flexibility = solved.values(columns.flexibility);
    fit.flexibility_u = solved.u(columns.flexibility);
  }
  fit.offset = solved.values.segment<2>(columns.offset);
  fit.offset_u = {solved.u(columns.offset), solved.u(columns.offset + 1)};
  if (columns.load_bias >= 0) {
    fit.load_bias = solved.values.segment<2>(columns.load_bias);
    fit.load_bias_u = {solved.u(columns.load_bias), solved.u(columns.load_bias + 1)};
  }
  fit.rms_train = rms_of(split.train, data, &solved, chained, element);
  fit.rms_validation = rms_of(split.validation, data, &solved, chained, element);
  return fit;
}

/// Tests the beam term and draws the conclusion.
void judge_beam(const Solved& solved, std::size_t e, const DeflectionData& data,
                double largest_load, double sigma, ElementResult& result) {
  const int column = solved.layout.elements[e].flexibility;
  const DeflectionElement& element = data.elements[e];
  if (column < 0) {
    result.sentence = fmt::format(
        "element {}: reflectors at one distance only; they cannot tell a bent link from a joint "
        "that gives way",
        element.element);
    return;
  }
  const double value = solved.values(column);
  const double bending = beam(element, moments_of(element, largest_load), element.length);
  result.f = value * value / (solved.unscaled(column, column) * solved.factor());
  result.p_value = p_of_t(std::sqrt(result.f), solved.freedom());
  result.aic_gain = solved.equations * std::log1p(result.f / solved.freedom()) - 2;
  result.end_bending = value * bending;
  result.end_bending_u = solved.u(column) * std::abs(bending);
  const double unseen = std::abs(result.end_bending) + result.end_bending_u;
  if (result.p_value < kSignificant && result.aic_gain > 0 && value > 0) {
    result.verdict = LinkVerdict::kBends;
    result.sentence = fmt::format(
        "element {}: the link bends, {:.3f} mm at its end under {:.0f} N (U {:.3f} mm)",
        element.element, to_mm(result.end_bending), largest_load, to_mm(result.end_bending_u));
  } else if (unseen < kSeen * sigma) {
    result.verdict = LinkVerdict::kRigid;
    result.sentence =
        fmt::format("element {}: rigid link; more than {:.3f} mm at its end would have been seen",
                    element.element, to_mm(unseen));
  } else {
    result.sentence = fmt::format(
        "element {}: cannot tell; a link that bends up to {:.3f} mm at its end fits as well as a "
        "softer joint",
        element.element, to_mm(unseen));
  }
}

/// Elements that may show a beam, since their reflectors stand at several distances. Checks the
/// elements for which a load bias was requested.
Result<std::set<int>> beams_of(const DeflectionData& data, const Split& split,
                               const std::set<int>& load_biases) {
  std::map<int, std::set<double>> distances;
  for (const DeflectionReading* reading : split.train)
    distances[reading->element].insert(reading->x);
  for (const int element : load_biases) {
    if (!distances.contains(element))
      return refused("no training readings of element {}", element)
          .in(data.where)
          .of("element")
          .with_value(element);
  }
  std::set<int> beams;
  for (const DeflectionElement& element : data.elements) {
    if (distances[element.element].size() >= 2) beams.insert(element.element);
  }
  return beams;
}

/// Both models, fitted.
struct BothModels {
  const DeflectionData& data;
  const DeflectionOptions& options;
  const Split& split;
  std::set<int> beams, load_biases;
  Solved beam, rigid;

  [[nodiscard]] double largest_load() const {
    return std::max(split.training_loads.back(),
                    split.validation_loads.empty() ? 0.0 : split.validation_loads.back());
  }
  /// The largest sigma of the readings of one element, scaled as the residuals demand.
  [[nodiscard]] double sigma_of_element(int element) const {
    double sigma = 0;
    for (const DeflectionReading* reading : split.train) {
      if (reading->element == element) sigma = std::max(sigma, sigma_of(*reading, options));
    }
    return sigma * std::sqrt(std::max(1.0, beam.factor()));
  }
};

/// Judges whether the foot of the element moves with the load, if no load bias was requested.
void judge_load_bias(const BothModels& models, ElementResult& element) {
  if (!models.beams.contains(element.element) || models.load_biases.contains(element.element))
    return;
  std::set<int> more = models.load_biases;
  more.insert(element.element);
  const Result<Solved> moved =
      solve(models.data, models.split.train, models.options, models.beams, more);
  if (!moved) return;
  const double f = (models.beam.cost - moved->cost) / 2 / moved->factor();
  element.load_bias_p_value = p_of_f2(std::max(0.0, f), moved->freedom());
  if (element.load_bias_p_value >= kSignificant) return;
  element.sentence +=
      fmt::format("; its foot moves with the load (p = {:.1g}): fit again with a load bias",
                  element.load_bias_p_value);
}

ElementResult element_result(const BothModels& models, std::size_t e) {
  const bool chained = models.options.chained;
  ElementResult element;
  element.element = models.data.elements[e].element;
  element.rigid = fit_of(models.rigid, e, models.data, models.split, chained);
  if (models.beams.contains(element.element))
    element.beam = fit_of(models.beam, e, models.data, models.split, chained);
  judge_beam(models.beam, e, models.data, models.largest_load(),
             models.sigma_of_element(element.element), element);
  judge_load_bias(models, element);
  return element;
}

}  // namespace

Result<DeflectionResult> fit_deflection(const DeflectionData& data,
                                        const DeflectionOptions& options) {
  const Split split = TRY(split_of(data, options));
  const std::set<int> load_biases(options.load_bias.begin(), options.load_bias.end());
  const std::set<int> beams = TRY(beams_of(data, split, load_biases));
  const Solved with = TRY(solve(data, split.train, options, beams, load_biases));
  const Solved without = TRY(solve(data, split.train, options, {}, load_biases));
  const BothModels models{data, options, split, beams, load_biases, with, without};

  DeflectionResult result;
  result.training_loads = split.training_loads;
  result.validation_loads = split.validation_loads;
  result.freedom = with.freedom();
  result.variance_factor = with.factor();
  for (std::size_t e = 0; e < data.elements.size(); ++e)
    result.elements.push_back(element_result(models, e));
  const auto& shown = split.validation.empty() ? split.train : split.validation;
  result.rms_still = rms_of(shown, data, nullptr, options.chained, 0);
  result.rms_beam = rms_of(shown, data, &with, options.chained, 0);
  result.rms_rigid = rms_of(shown, data, &without, options.chained, 0);
  return result;
}

}  // namespace trammel
