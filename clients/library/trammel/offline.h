#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trammel/result.h"
#include "trammel/types.h"

/// Everything that works on files, without a service. All classes are immutable values, cheap to
/// copy and thread-safe. Work runs in the calling thread.
namespace trammel::api {

/// A cell as its file describes it: the robot, its base, tools, payloads and tracker.
class TRAMMEL_API Cell {
 public:
  /// Reads a cell file (YAML) and the robot file that it names.
  [[nodiscard]] static Result<Cell> load(const std::string& path);

  /// Its name.
  [[nodiscard]] std::string name() const;
  /// Name of its robot.
  [[nodiscard]] std::string robot() const;
  /// Number of joints n.
  [[nodiscard]] std::size_t joints() const;
  /// Names of the joints in files, n of them: `q1_deg`, for a rail `q1_mm`.
  [[nodiscard]] std::vector<std::string> joint_columns() const;
  /// Ids of its tools.
  [[nodiscard]] std::vector<std::string> tools() const;
  /// Ids of its payloads.
  [[nodiscard]] std::vector<std::string> payloads() const;
  /// Where the nominal robot has the tool (X_BT) at N joint vectors, given one after the other (N x
  /// n values, deg; for a rail mm). `tool`: empty: the cell's only one; `flange`: no tool. Refuses
  /// a tool whose place is not known.
  [[nodiscard]] Result<std::vector<Pose>> tool_poses(std::span<const double> joints_deg,
                                                     const std::string& tool = {}) const;

  /// The parts that it is made of.
  struct Inside;
  /// For the library itself.
  explicit Cell(std::shared_ptr<const Inside> inside) : inside_(std::move(inside)) {}
  /// For the library itself.
  [[nodiscard]] const Inside& inside() const { return *inside_; }

 private:
  std::shared_ptr<const Inside> inside_;
};

/// Measurements taken together.
class TRAMMEL_API Batch {
 public:
  /// Reads a batch file: our CSV, or RoboDK's.
  [[nodiscard]] static Result<Batch> load(const std::string& path);
  /// load() from a text; `name` becomes the batch's id and names it in errors.
  [[nodiscard]] static Result<Batch> parse(const std::string& csv, const std::string& name);

  /// Its id.
  [[nodiscard]] std::string name() const;
  /// Number of poses.
  [[nodiscard]] std::size_t size() const;
  /// Its text as it came.
  [[nodiscard]] std::string csv() const;
  /// Its rows as a batch file of the plain kind: commas, decimal points, names in lower case,
  /// no comments.
  [[nodiscard]] std::string table() const;

  /// The parts that it is made of.
  struct Inside;
  /// For the library itself.
  explicit Batch(std::shared_ptr<const Inside> inside) : inside_(std::move(inside)) {}
  /// For the library itself.
  [[nodiscard]] const Inside& inside() const { return *inside_; }

 private:
  std::shared_ptr<const Inside> inside_;
};

/// Figures of the position errors |measured - predicted| of some poses.
struct Figures {
  double rms_mm = 0;                       ///< root mean square, mm
  double mean_mm = 0;                      ///< mean, mm
  double p997_mm = 0;                      ///< 99.7 % are smaller, mm
  double max_mm = 0;                       ///< largest, mm
  std::array<double, 3> axis_mean_mm{};    ///< mean by axis of B, mm
  std::array<double, 3> axis_stddev_mm{};  ///< standard deviation by axis of B, mm
};

/// Orientation errors, where orientations were measured: rms of the rotation angle.
struct OrientationErrors {
  int poses = 0;                   ///< with a measured orientation
  double nominal_rms_deg = 0;      ///< of the drawing, deg
  double calibrated_rms_deg = 0;   ///< with the error sources identified, deg
  double compensated_rms_deg = 0;  ///< with the learned bias, deg
  std::optional<double>
      coverage_95;  ///< share of coordinates inside their 95 % interval; empty: not learned
};

/// The three levels of one model on the same poses.
struct Evaluation {
  int poses = 0;               ///< number of poses
  int in_domain = 0;           ///< the number of poses in domain
  double coverage_95 = 0;      ///< share of coordinates inside their 95 % interval
  Figures nominal;             ///< of the drawing
  Figures calibrated;          ///< with the error sources identified
  Figures compensated;         ///< with the learned bias
  std::optional<double> nlpd;  ///< mean negative log predictive density, nat, positions in mm
  std::optional<OrientationErrors> orientation;  ///< if orientations were measured
  std::string doubt_of_bias;  ///< a sentence if the bias does not help; else empty
  int trained_on =
      0;  ///< the number of poses that the model was trained on: they only show how well it fits
  /// Share of coordinates inside the 95 % interval of the stated sigma alone: whether the model is
  /// as good as the instrument.
  std::optional<double> coverage_95_stated;
};

/// One identified parameter of a model.
struct Parameter {
  std::string name;         ///< as in files: `gamma0`, `C2`
  std::string unit;         ///< of value and u95: lengths mm, angles deg
  double value = 0;         ///< the correction to the drawing
  double u95 = 0;           ///< two standard uncertainties
  bool identified = false;  ///< true if the poses determine it better than the prior did
};

/// The training poses of a model: its stated accuracy applies to these.
struct Measured {
  std::string sentence;         ///< a summary in words; without a record it says so
  int poses = 0;                ///< 0: not on record, in models from before it was recorded
  std::vector<int> from_above;  ///< poses that each joint fell into
  std::vector<int> from_below;  ///< poses that each joint rose into
  std::optional<double> temperature_min_c;  ///< degrees Celsius; empty: not measured
  std::optional<double> temperature_max_c;  ///< likewise
  std::array<double, 3> lower_mm{};         ///< a corner of the box in B that the tool was in, mm
  std::array<double, 3> upper_mm{};         ///< the opposite corner, mm
  double volume_m3 = 0;            ///< of the box, the part within reach of a measured tool place
  std::optional<double> reach_mm;  ///< mm: a pose farther from all measured places is out of domain
  std::string instrument;          ///< its name in the cell file, with its stated sigma
};

/// What is left of a measured pose, measured - predicted, in B.
struct Residual {
  std::string pose_id;                        ///< its name in the batch
  std::array<double, 3> nominal_mm = {};      ///< against the robot as drawn
  std::array<double, 3> calibrated_mm = {};   ///< with the identified parameters
  std::array<double, 3> compensated_mm = {};  ///< with the learned bias, too
  std::array<double, 3> stddev_mm = {};       ///< as predicted, of compensated
  bool in_domain = false;                     ///< the model knows enough there
};

/// The options of a health check.
struct CheckOptions {
  std::optional<double> tolerance_mm = {};  ///< what the cell must hold; empty: its file's
  bool new_tool = false;  ///< the tool was mounted anew: where it sits is found, and is no change
  std::vector<std::string> earlier = {};  ///< what earlier checks of this robot said (JSON)
};

/// A file of a robot program.
struct ProgramFile {
  std::string name;  ///< with its ending, by which the dialect is known
  std::string text;  ///< its bytes
};

/// The options of the correction of a program.
struct ProgramOptions {
  std::string format;        ///< the dialect; empty: by the endings
  std::string tool;          ///< of the cell; empty: as the program says, or the only one
  std::string payload;       ///< of the cell; empty: as the program says, or the only one
  bool keep_digits = false;  ///< numbers keep their decimals, whatever rounding costs
};

/// A corrected program.
struct CorrectedFiles {
  std::vector<ProgramFile> files;  ///< every byte that is no corrected number as it was
  std::string receipt_csv;         ///< a row for each target, as `trammel correct --receipt` has it
  std::string receipt_json;        ///< the same for programs
  bool all = false;                ///< every target is corrected
};

/// Nominal chain, identified error sources and learned bias.
class TRAMMEL_API Model {
 public:
  /// Reads a model file. Refuses one whose hash does not fit its content.
  [[nodiscard]] static Result<Model> load(const std::string& path);
  /// load() from the model's text, as a service exports it; `where` names it in errors.
  [[nodiscard]] static Result<Model> parse(const std::string& text, const std::string& where);
  /// Writes the model file, whole or not at all.
  [[nodiscard]] Status save(const std::string& path) const;
  /// The text of that file.
  [[nodiscard]] std::string text() const;

  /// Its id, cell, level and batch.
  [[nodiscard]] ModelFacts facts() const;
  /// The cell that it was trained for.
  [[nodiscard]] Cell cell() const;
  /// The kernel of its bias; `none` without.
  [[nodiscard]] std::string bias() const;
  /// Its P parameters.
  [[nodiscard]] std::vector<Parameter> parameters() const;
  /// P x P covariance of the parameters, row by row, in the products of their units.
  [[nodiscard]] std::vector<double> parameter_covariance() const;
  /// Errors on poses held out from training, else on the training poses.
  [[nodiscard]] Evaluation figures() const;
  /// The training poses that its promise is about.
  [[nodiscard]] Measured measured() const;
  /// The error budget: JSON, as `budget` of `trammel train --json`; `null` if no training pose has
  /// a position.
  [[nodiscard]] std::string budget_json() const;
  /// The notes that a user of the model should know, the gravest first.
  [[nodiscard]] std::vector<Note> notes() const;

  /// The expected error at N joint vectors, given one after the other (N x n values, deg; for a
  /// rail mm). Refuses joints beyond the robot's limits, numbers that are not finite, and a tool
  /// with a payload that no training pose had.
  [[nodiscard]] Result<std::vector<Prediction>> predict(std::span<const double> joints_deg,
                                                        const Context& context = {}) const;
  /// The commands by which the tool lands on each target. A target that cannot be corrected says so
  /// in its status. Refuses invalid targets (wrong number of joints, no branch, a quaternion that
  /// is not normalised), and the same tools as predict().
  [[nodiscard]] Result<std::vector<CorrectedTarget>> correct(std::span<const Target> targets,
                                                             const Context& context = {}) const;
  /// Measured against predicted. Several batches are sessions of one arm.
  [[nodiscard]] Result<Evaluation> evaluate(std::span<const Batch> batches) const;
  /// The same pose by pose, as `trammel evaluate --residuals` has it.
  [[nodiscard]] Result<std::vector<Residual>> residuals(std::span<const Batch> batches) const;
  /// Whether the robot is still the one that the model was trained on: JSON, as `trammel check
  /// --json`.
  [[nodiscard]] Result<std::string> check(const Batch& batch,
                                          const CheckOptions& options = {}) const;
  /// The model's page: HTML that opens without a network, as `trammel report` writes it. `batches`:
  /// fresh measurements to compare it with; poses that it was trained on are left out.
  [[nodiscard]] Result<std::string> report(std::span<const Batch> batches = {}) const;
  /// Corrects a robot program as `trammel correct` does.
  [[nodiscard]] Result<CorrectedFiles> correct_program(std::span<const ProgramFile> files,
                                                       const ProgramOptions& options = {}) const;

  /// The parts that it is made of.
  struct Inside;
  /// For the library itself.
  explicit Model(std::shared_ptr<const Inside> inside) : inside_(std::move(inside)) {}
  /// For the library itself.
  [[nodiscard]] const Inside& inside() const { return *inside_; }

 private:
  std::shared_ptr<const Inside> inside_;
};

/// What a cell went through, over models of it, the oldest first: JSON, as `trammel history
/// --json`.
[[nodiscard]] TRAMMEL_API Result<std::string> history(std::span<const Model> models);

/// The options of a training.
struct TrainOptions {
  std::optional<std::string>
      level;  ///< instead of the cell's error sources: `M0` to `M3`, `M2,gear_transmission:3`
  std::optional<std::string> bias;  ///< instead of the cell's: `none`, `auto`, a kernel
  std::uint64_t seed = 1;           ///< of the search for hyperparameters and of the rows held out
  double validation_share = 0;      ///< of the rows, held out where the batch has no column `set`
  Progress progress;                ///< may be empty
  bool as_read = false;  ///< a person has looked at the batches: learn from them as they are
  std::vector<Model> fleet = {};  ///< of robots of the same type, at least three: their common
                                  ///< values become the prior of this one. A cell with `prior:
                                  ///< fleet` needs them
};
/// A model of the cell, from batches of measurements. Several batches are sessions of one arm.
/// Refuses the batches that a service quarantines: a misread batch, or one with a change in its
/// middle. With `as_read` the model's notes report that instead; with `fleet` they report in which
/// parameters the robot differs from its twins.
[[nodiscard]] TRAMMEL_API Result<Model> train(const Cell& cell, std::span<const Batch> batches,
                                              const TrainOptions& options = {});

/// The options of a diagnosis.
struct DiagnoseOptions {
  std::uint64_t seed = 1;  ///< of the bootstrap
  Progress progress;       ///< may be empty
};
/// The causes that the cell's model lacks, as JSON: the output of `trammel diagnose --json`.
[[nodiscard]] TRAMMEL_API Result<std::string> diagnose(const Cell& cell,
                                                       std::span<const Batch> batches,
                                                       const DiagnoseOptions& options = {});

/// The gain of extending a cell by the findings of a diagnosis.
struct Extension {
  std::string findings;        ///< the diagnosis, as diagnose() writes it
  std::optional<Model> model;  ///< the extended model; empty where it is not to be applied
  std::vector<std::string> error_sources;  ///< those of it that belong in the cell file
  std::string why_not;  ///< why nothing is applied, in the words of every door; empty: apply it
};
/// Does the same as `trammel diagnose --apply` without writing anything: it sets some rows aside
/// before it examines the batch, extends the cell by the findings, and recommends the model if a
/// service would put it in force.
[[nodiscard]] TRAMMEL_API Result<Extension> extend(const Cell& cell, std::span<const Batch> batches,
                                                   const DiagnoseOptions& options = {});

/// The options of a plan.
struct PlanOptions {
  std::size_t count = 0;          ///< number of poses
  std::uint64_t seed = 1;         ///< of the draw
  std::string criterion = "lhs";  ///< `lhs`, `observability`, `separate:CAUSE,CAUSE` or `check`
  bool positions_only = false;    ///< choose for a single reflector, which shows no orientations
};
/// Poses to measure.
struct Plan {
  std::vector<std::string> pose_ids;  ///< one a pose
  std::vector<double> joints_deg;     ///< N x n, one pose after the other, deg; of a rail mm
  std::string csv;                    ///< the text that `trammel plan -o` writes
};
/// Poses of the cell, inside its workspace and in sight of its tracker.
[[nodiscard]] TRAMMEL_API Result<Plan> plan(const Cell& cell, const PlanOptions& options);

/// The options of a simulation.
struct SimulateOptions {
  std::uint64_t seed = 1;       ///< of the measuring noise
  bool positions_only = false;  ///< leave out orientations, as a single reflector does
  bool noise_free = false;      ///< write where the tool really is
};
/// Measures a plan (its CSV) on a virtual robot; `truth` is the path of a truth file.
[[nodiscard]] TRAMMEL_API Result<Batch> simulate(const Cell& cell, const std::string& truth,
                                                 const std::string& plan_csv,
                                                 const SimulateOptions& options = {});

}  // namespace trammel::api
