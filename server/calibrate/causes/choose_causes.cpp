#include "server/calibrate/causes/choose_causes.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/calibrate/calibrate_with_maps.h"
#include "server/calibrate/causes/cause_evidence.h"
#include "server/calibrate/causes/joint_blocks.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/identify/check_needs.h"
#include "server/calibrate/identify/order_search.h"
#include "server/calibrate/maps/learned_maps.h"
#include "server/error_sources/catalogue.h"

namespace trammel {

namespace {

using causes::Scope;
using causes::SearchFamily;

constexpr int kHarmonics = 60;  // of a map: waves of 6 degrees; finer ones cost and bring little
constexpr double kWorth = 3;    // nat: so much likelier must the batch be with one cause
constexpr double kSure = 20;  // nat: with such a gain, left-out blocks refuse the cause only if it
                              // harms them beyond chance
constexpr double kStandardErrors = 2;  // chance alone exceeds them in 1 of 40 cases

constexpr const char* kTaken = "the poses show it, and it predicts poses that were left out";
constexpr const char* kHarmless =
    "the poses show it clearly, and it harms none that were left out beyond chance";
constexpr const char* kPredictsNothing = "it does not predict poses that were left out";
constexpr const char* kNotShown = "the poses do not show it";

bool is_listed(const std::vector<std::string>& specs, const CauseRecord& record) {
  return std::any_of(specs.begin(), specs.end(),
                     [&](const std::string& spec) { return find_cause(spec) == &record; });
}

/// The sources that every training identifies, whatever the data show.
std::vector<std::string> always_identified(const Cell& cell, const std::vector<std::string>& kept) {
  std::vector<std::string> specs = spelled_out(kept, cell);
  for (const causes::Part part : {causes::Part::kBase, causes::Part::kLinks, causes::Part::kTool}) {
    const CauseRecord& record = cause_correcting(part);
    if (part == causes::Part::kTool && cell.tools.empty()) continue;
    if (!is_listed(specs, record)) specs.emplace_back(record.spelling);
  }
  return with_unknown_tool(std::move(specs), cell);
}

/// The compliance that a load needs in order to show; null for other causes. Neither of the two is
/// linear without the other.
const CauseRecord* gives_way_under(const CauseRecord& record) {
  if (!record.added_by_data) return nullptr;
  const CauseRecord& beside = cause_spelled(record.added_by_data->beside);
  return beside.gives_way ? &beside : nullptr;
}

/// Lasting, of the arm, and linear about an arm without it.
bool may_be_tried(const CauseRecord& record) {
  const bool of_robot = record.scope == Scope::kArm || record.scope == Scope::kJoint;
  const bool linear = record.search == SearchFamily::kColumns ||
                      record.search == SearchFamily::kPlay || record.search == SearchFamily::kMap ||
                      record.search == SearchFamily::kOrder;
  return of_robot && linear && record.lasting == causes::Lasting::kAlways &&
         record.part == causes::Part::kNone && record.forms.size() == 1 &&
         gives_way_under(record) == nullptr;
}

/// The sources of one cause: of the whole arm, or of each joint.
std::vector<std::string> spellings(const CauseRecord& record, const Cell& cell) {
  const std::string name(record.spelling);
  if (record.scope != Scope::kJoint) return {name};
  return spelled_out({name + ":*"}, cell);
}

ColumnGroup columns_of_source(const PhysicalModel& model, const std::string& name) {
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (source->name() == name) return {first, count};
    first += count;
  }
  return {};
}

/// m: of one axis, of one row alone.
double mean_sigma(const CalibrationResult& found, const MeasurementBatch& batch) {
  const Weights weights = weights_of(found, batch);
  double square = 0;
  for (const Measurement& m : batch.measurements) {
    square +=
        std::pow(position_sigma(m, *found.model.cell), 2) + std::pow(weights.beside_alone(m), 2);
  }
  return std::sqrt(square / static_cast<double>(batch.measurements.size()));
}

/// The prediction errors of left-out blocks, m²: one number per block. They add up to the mean
/// square of Euclidean errors.
using Missed = Eigen::VectorXd;

double rms(const Missed& missed) { return std::sqrt(missed.sum()); }

/// True if the error is smaller. If the cause is `sure`, the error may be larger by chance, judged
/// by the differences between blocks.
bool predicts(const Missed& before, const Missed& after, bool sure) {
  const Eigen::ArrayXd gain = before - after;
  if (gain.sum() > 0 || !sure) return gain.sum() > 0;
  const auto n = static_cast<double>(gain.size());
  const double scatter = (gain - gain.mean()).square().sum() / std::max(n - 1, 1.0);
  return gain.sum() >= -kStandardErrors * std::sqrt(n * scatter);
}

/// A cause that is tried: its columns in the linear arm.
struct Candidate {
  std::string named;   ///< the spelling of a person
  std::string source;  ///< the spelling in the model and in the list to identify
  double chance = 0;   ///< nat: what the best of the orders that were searched gains by chance
  ColumnGroup columns = {};
};

// Of the whole choice, by the time that they take on a few thousand poses of an arm of six joints.
constexpr double kBaseShare = 0.04, kLoadShare = 0.2, kCandidateShare = 0.5;

class CauseSearch {
 public:
  CauseSearch(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
              const std::function<Status(double)>& go_on)
      : cell_(cell), batch_(batch), go_on_(go_on), blocks_(joint_blocks(batch)) {}

  Result<ChosenCauses> run(const std::vector<std::string>& kept) {
    chosen_.sources = always_identified(*cell_, kept);
    base_ = TRY(calibrate_with_maps(cell_, chosen_.sources, batch_, {}));
    held_out_ = missed(base_);
    TRY(go_on_(kBaseShare));
    try_load();
    TRY(go_on_(kLoadShare));
    add_candidates();
    TRY(go_on_(kCandidateShare));
    if (!candidates_.empty()) TRY(try_others());
    chosen_.choice.held_out = rms(held_out_);
    return std::move(chosen_);
  }

 private:
  /// Tries loads together with the compliances under them. Their effect is a product, so both are
  /// identified together, and the arm is linearised at the result.
  void try_load() {
    const CauseRecord* yielding = nullptr;
    std::vector<std::string> load;
    for (const CauseRecord* record : all_causes()) {
      const CauseRecord* beside = gives_way_under(*record);
      if (beside == nullptr) continue;
      yielding = beside;
      if (!record->added_by_data->is_known(*cell_) && !is_listed(chosen_.sources, *record))
        load.emplace_back(record->spelling);
    }
    if (yielding == nullptr || is_listed(chosen_.sources, *yielding)) return;
    load.insert(load.begin(), std::string(yielding->spelling));
    std::vector<std::string> specs = chosen_.sources;
    specs.insert(specs.end(), load.begin(), load.end());
    Result<CalibrationResult> loaded = calibrate_with_maps(cell_, specs, batch_, {});
    if (!loaded) return;
    const double gain = loaded->log_evidence - base_.log_evidence;
    const double freedom = loaded->rank - base_.rank;
    if (!judged({load, 0, 0, gain, freedom, false, {}}, missed(*loaded))) return;
    chosen_.sources = std::move(specs);
    // The likeliest form stays. It is not compared again beside hundreds of parameters.
    for (const ErrorSourcePtr& source : loaded->model.sources) {
      if (&source->cause() != yielding) continue;
      std::replace(chosen_.sources.begin(), chosen_.sources.end(), std::string(yielding->spelling),
                   source->name());
    }
    base_ = std::move(*loaded);
  }

  /// Adds the cause to the table with the prediction errors `after`. Returns true if it is taken.
  bool judged(TriedCause tried, const Missed& after) {
    const bool shown = tried.gain > worth_;
    tried.held_out_before = rms(held_out_);
    tried.held_out_after = rms(after);
    tried.taken = shown && predicts(held_out_, after, tried.gain > kSure);
    const bool gains = tried.held_out_after < tried.held_out_before;
    tried.why = !shown ? kNotShown : !tried.taken ? kPredictsNothing : gains ? kTaken : kHarmless;
    if (tried.taken) held_out_ = after;
    chosen_.choice.tried.push_back(std::move(tried));
    return chosen_.choice.tried.back().taken;
  }

  void add_candidates() {
    model_ = base_.model;
    std::vector<int> joints;
    for (const CauseRecord* record : all_causes()) {
      if (!may_be_tried(*record)) continue;
      for (const std::string& spec : spellings(*record, *cell_)) {
        if (is_kept(spec)) continue;
        if (const std::optional<int> joint = joint_of_open_map(spec)) {
          joints.push_back(*joint);
        } else {
          add_candidate(spec, spec);
        }
      }
    }
    if (!joints.empty()) {
      for (const auto& [joint, spectrum] : learned_maps(base_, batch_, joints, kHarmonics)) {
        const std::string map = spelled_map(joint, spectrum);
        add_candidate(without_learned_spectrum(map), map);
      }
    }
    for (Candidate& one : candidates_) one.columns = columns_of_source(model_, one.source);
    // The best of many gains something by chance.
    worth_ += std::log(std::max<double>(1, static_cast<double>(candidates_.size())));
  }

  [[nodiscard]] bool is_kept(const std::string& spec) const {
    const auto& kept = chosen_.sources;
    return std::any_of(kept.begin(), kept.end(), [&](const std::string& other) {
      return without_learned_spectrum(other) == spec || other.starts_with(spec + "@");
    });
  }

  /// If the cell can have the source, and the batch could show it.
  void add_candidate(const std::string& named, const std::string& spec) {
    const Result<ErrorSourcePtr> source = make_error_source(spec, *cell_);
    if (!source || (*source)->parameters().empty()) return;
    if (const auto search = (*source)->search()) {
      add_candidate(named, with_likeliest_order(**source, base_, batch_));
      if (!candidates_.empty() && candidates_.back().named == named)
        candidates_.back().chance = std::log((search->to - search->from) / search->step);
      return;
    }
    CalibrationProblem alone{model_, batch_};
    alone.model.sources = {*source};
    if (!check_needs(alone)) return;
    add_source(model_, *source);
    candidates_.push_back({named, (*source)->name(), 0, {}});
  }

  /// Tries the remaining causes by falling gain, each beside those taken before it.
  Status try_others() {
    std::vector<ColumnGroup> present;
    for (const ErrorSourcePtr& source : base_.model.sources)
      present.push_back(columns_of_source(model_, source->name()));
    CauseEvidence evidence = evidence_of(base_, model_, present);
    const double in_space = 3 * std::pow(mean_sigma(base_, batch_), 2);
    held_out_ = in_space * evidence.left_out();
    const auto all = static_cast<double>(candidates_.size());
    while (!candidates_.empty()) {
      TRY(go_on_(1 - (1 - kCandidateShare) * static_cast<double>(candidates_.size()) / all));
      std::vector<CauseEvidence::Gain> gains;
      for (const Candidate& one : candidates_) {
        gains.push_back(evidence.gain_of(one.columns));
        gains.back().nat -= one.chance;
      }
      const auto largest = std::max_element(gains.begin(), gains.end(),
                                            [](auto& a, auto& b) { return a.nat < b.nat; });
      const auto one = candidates_.begin() + (largest - gains.begin());
      const Missed after =
          largest->nat > worth_ ? in_space * evidence.left_out(one->columns) : held_out_;
      if (judged({{one->named}, 0, 0, largest->nat, largest->freedom, false, {}}, after)) {
        evidence.take(one->columns);
        chosen_.sources.push_back(one->source);
      }
      candidates_.erase(one);
    }
    return {};
  }

  /// About the arm that was `found`; `model` has further sources.
  [[nodiscard]] CauseEvidence evidence_of(const CalibrationResult& found,
                                          const PhysicalModel& model,
                                          const std::vector<ColumnGroup>& present) const {
    return {{model, aligned(batch_, found.sessions, cell_->tracker)},
            weights_of(found, batch_),
            blocks_,
            present};
  }

  /// With the sources of `found`.
  [[nodiscard]] Missed missed(const CalibrationResult& found) const {
    const ColumnGroup all{0, found.model.values.size()};
    return 3 * std::pow(mean_sigma(found, batch_), 2) *
           evidence_of(found, found.model, {all}).left_out();
  }

  std::shared_ptr<const Cell> cell_;
  const MeasurementBatch& batch_;
  const std::function<Status(double)>& go_on_;
  std::vector<std::vector<std::size_t>> blocks_;
  CalibrationResult base_;
  PhysicalModel model_;  // with all candidates
  std::vector<Candidate> candidates_;
  double worth_ = kWorth;  // nat: the gain of likelihood that a cause must bring
  Missed held_out_;        // with what was taken
  ChosenCauses chosen_;
};

}  // namespace

Result<ChosenCauses> choose_causes(const std::shared_ptr<const Cell>& cell,
                                   const std::vector<std::string>& kept,
                                   const MeasurementBatch& batch,
                                   const std::function<Status(double share)>& go_on) {
  return CauseSearch(cell, batch, go_on).run(kept);
}

}  // namespace trammel
