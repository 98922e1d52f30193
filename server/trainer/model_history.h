#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "server/base/mutex.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/tasks/accept/gate.h"
#include "server/tasks/accept/verdict.h"
#include "server/trainer/cell_book.h"
#include "server/trainer/recent_poses.h"

namespace trammel {

/// A model from a job, and the sessions that judge it.
struct Candidate {
  const CompensatedModel& model;
  StoredJob job;
  std::string remarks = {};                      ///< go with the outcome
  std::string text = {};                         ///< of the model, see NewModel
  std::optional<std::int64_t> peak_memory = {};  ///< bytes, see JobOutcome
  std::optional<double> processor_time = {};     ///< s
};

/// Holds the candidate against others, wherever that is computed.
using Judging = std::function<Result<GateVerdict>(const Opponents& opponents)>;

/// The fate of a candidate.
struct Kept {
  int version = 0;
  bool in_force = false;
  std::string message;  ///< the figures it was judged by, the limit and why
  JobOutcome outcome;   ///< the same as data
};

/// The trouble with the model that a cell is served with, or why it is served with none.
struct CellTrouble {
  enum class Kind {
    kOfAnotherRobot,  ///< not served: its robot or its tools differ from the model's
    kUnreadable,      ///< not served: no version in force can be read
    kSetApart,        ///< not served here: another server has other files of the cell
    kFormerFiles,     ///< served until this server restarts: the record has changed to other files
    kOlderServed,     ///< served with an older version
    kCopyServed       ///< served with the right one, which only its copy still has
  } kind = Kind::kUnreadable;
  std::string what;  ///< one sentence
};

/// The models of all cells: their versions, the one in force, and its automatic successors.
///
/// Thread-safe, except set_listener(). The version in force changes one at a time for each cell; a
/// cell never waits for another one. Models are judged before the lock of their cell is taken, so
/// nobody waits for the judging.
class ModelHistory {
 public:
  /// Called when a model was stored, with in_force true if it was also put in force. Calls come in
  /// the order of the changes of the cell, while other changes of the cell wait. So it must not
  /// call functions that change models.
  using Listener = std::function<void(const ServedModel&, bool in_force)>;

  /// The arguments outlive it. The registry loads its models from it.
  ModelHistory(const CellBook& cells, Store& store, ModelRegistry& registry);
  ~ModelHistory();
  ModelHistory(const ModelHistory&) = delete;
  ModelHistory& operator=(const ModelHistory&) = delete;

  void set_listener(Listener listener) { listener_ = std::move(listener); }
  /// Announces the version in force of the store, if any; it is loaded at the first request. If it
  /// cannot be loaded, the last version that served before it takes its place, and troubles()
  /// reports that. A version that does not fit the cell is not served, and not replaced.
  [[nodiscard]] Status announce_from_store(const std::string& cell);
  /// Announces the versions of all cells; returns the troubles, one sentence each.
  [[nodiscard]] std::vector<std::string> announce_all();
  /// One sentence for each cell that is served with another model than intended, or with none.
  [[nodiscard]] std::vector<std::string> troubles() const;
  /// The troubles by cell.
  [[nodiscard]] std::map<std::string, CellTrouble> cell_troubles() const;

  /// The recently requested poses of the cells. If a candidate moves one of these by more than the
  /// cell's step limit, only a person can put it in force.
  [[nodiscard]] RecentPoses& recent_poses() { return recent_poses_; }

  /// The model of a cell that is served here; refused when its robot or its tools are not the
  /// cell's any more.
  [[nodiscard]] Result<CompensatedModel> load_for_service(const std::string& cell,
                                                          int version) const;
  /// Puts a stored version in force and publishes it. A version that is already served is not
  /// published again. `judged`: the comparison with the one in force.
  [[nodiscard]] Status activate(const std::string& cell, int version, const ChangeId& id = {},
                                const std::optional<GateVerdict>& judged = {});
  /// Returns to the version in force before, or to the last earlier one that can be served; returns
  /// its number. Refuses (kBusy) if others keep changing the version in force.
  [[nodiscard]] Result<int> rollback(const std::string& cell, const ChangeId& id = {});
  /// Adds a model file from elsewhere to the history without putting it in force. Returns its
  /// version, or the present version if the same model is there already. Refuses a model of another
  /// cell, robot or tool.
  [[nodiscard]] Result<int> import_model(const std::string& cell, const std::string& text,
                                         const ChangeId& id = {});

  /// Serves the cell with the version that the store has in force: another server may have put it
  /// there. An error: that is not known, or it cannot be read now.
  Status follow(const std::string& cell);

  /// Stores the model, ends its job and, if `judging` says so, puts it in force. Batches that the
  /// job may release leave quarantine if the model goes in force, or if too few poses can judge it.
  /// The model is judged without its cell's lock, and again if another version went in force
  /// meanwhile; after a few times with the lock. Refuses (kBusy) after `stop` was requested, and if
  /// other servers keep changing the version in force.
  [[nodiscard]] Result<Kept> keep(const Candidate& candidate, const Judging& judging,
                                  const std::stop_token& stop = {});

 private:
  /// A model file from elsewhere for this cell.
  [[nodiscard]] Result<CompensatedModel> model_from(const std::string& cell,
                                                    const std::string& text,
                                                    const char* what) const;
  [[nodiscard]] Mutex& changes_of(const std::string& cell);
  /// Publishes a model that the store has put in force; the cell's lock is held.
  void put_in_force(ServedModelPtr model);
  /// The model to serve the cell with.
  [[nodiscard]] Result<ServedModel> load_in_force(const std::string& cell);
  /// Empty: there is none any more.
  void set_trouble(const std::string& cell, const std::optional<CellTrouble>& trouble);
  /// The target of a rollback.
  struct WayBack {
    int version_now = 0;
    std::vector<int> before;  ///< Store::previous_in_force()
    bool operator==(const WayBack&) const = default;
  };
  [[nodiscard]] Result<WayBack> way_back(const std::string& cell) const;
  /// The first of `before` that can be served: the number of steps back, and the model.
  [[nodiscard]] Result<std::pair<int, ServedModelPtr>> load_first(
      const std::string& cell, const std::vector<int>& before) const;
  /// The decision about a judged candidate: the message and the stored record.
  struct Judged {
    bool put_in_force = false, release = false;
    std::string message;
    JobOutcome outcome;
  };
  [[nodiscard]] Result<Judged> judged(const Candidate& candidate, const Judging& judging,
                                      const ServedModel* present) const;
  /// The cell's lock is held. `expected`: the version that the record had in force when it was
  /// judged.
  [[nodiscard]] Result<Kept> store(const Candidate& candidate, Judged judged, int expected);
  /// The opponents that a candidate of the cell is held against; `present` null: none in force.
  [[nodiscard]] Result<Opponents> opponents(const std::string& cell,
                                            const ServedModel* present) const;
  /// The last versions that served the cell before the one in force, as far as they can be read.
  [[nodiscard]] Result<std::vector<ModelText>> served_before(const std::string& cell) const;
  /// The version marked in force, where it could not be loaded.
  [[nodiscard]] Result<std::optional<RecordInForce>> record_not_loaded(
      const std::string& cell) const;

  /// The verdict, unless the model moves a recently requested pose by more than the cell allows.
  [[nodiscard]] GateVerdict within_step_limit(GateVerdict verdict, const Candidate& candidate,
                                              const ServedModel* present) const;

  const CellBook& cells_;
  Store& store_;
  ModelRegistry& registry_;
  Listener listener_;
  RecentPoses recent_poses_;
  Mutex changing_mutex_;
  // By cell; nothing leaves it. One change of a cell's models at a time.
  std::map<std::string, Mutex> changing_ TRAMMEL_GUARDED_BY(changing_mutex_);
  mutable Mutex troubles_mutex_;                                                     // taken last
  std::map<std::string, CellTrouble> troubles_ TRAMMEL_GUARDED_BY(troubles_mutex_);  // by cell
};

}  // namespace trammel
