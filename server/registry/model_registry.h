#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "server/base/mutex.h"
#include "server/base/result.h"
#include "server/compensate/served_model.h"
#include "server/registry/reclaimer.h"

namespace trammel {

/// The memory of a model's predictor, bytes, as far as it grows with the training poses.
[[nodiscard]] std::size_t bytes_of(const CompensatedModel& model);

/// The source of models that are not in memory. Called without a lock, for one version by one
/// thread at a time.
struct ModelSource {
  /// The model to serve the cell with: where the one in force cannot be loaded, another version.
  std::function<Result<ServedModel>(const std::string& cell)> in_force;
  std::function<Result<ServedModel>(const std::string& cell, int version)> version;
  /// A model that is in force was loaded, for the first time since it was announced.
  std::function<void(const ServedModelPtr&)> loaded;
};

/// The model in force for each cell, and the models in memory. Thread-safe. A reader gets the new
/// model or the previous one, never a mixture, and keeps it while it holds the pointer. Readers
/// never wait for training.
///
/// Loads models at their first request, each by one thread however many ask. A model leaves the
/// memory when it is over `budget` and that model has been unused for longest. Callers that must
/// not wait use ready().
class ModelRegistry {
 public:
  static constexpr std::size_t kNoLimit = SIZE_MAX;
  explicit ModelRegistry(std::size_t budget = kNoLimit) : budget_(budget) {}

  /// Null when the cell has no model in force. Waits while it is loaded.
  [[nodiscard]] ServedModelPtr in_force(const std::string& cell) const;
  /// The version in force, loaded or not; 0: none.
  [[nodiscard]] int version_in_force(const std::string& cell) const;
  /// Any version of the cell. Waits while it is loaded; passes on refusals of its source.
  [[nodiscard]] Result<ServedModelPtr> version(const std::string& cell, int version) const;
  /// The model that in_force() gives, without waiting.
  struct Ready {
    ServedModelPtr model;
    bool comes = false;  ///< it is not in memory, and will be loaded
  };
  [[nodiscard]] Ready ready(const std::string& cell) const;

  /// Replaces the model of its cell. Readers that hold the previous one keep it.
  void publish(ServedModelPtr model);
  /// As publish(), for a model that the first request loads.
  void announce(const std::string& cell, int version);
  /// A model that its last holder does not free itself.
  [[nodiscard]] ServedModelPtr reclaimed(ServedModel model) const {
    return reclaimer_->watch(std::move(model));
  }
  /// The models in force that are in memory, ordered by cell name.
  [[nodiscard]] std::vector<ServedModelPtr> all() const;
  /// The location of a cell's model in force.
  struct Place {
    int version = 0;
    enum class Where {
      kInMemory,
      kComes,  ///< it was never loaded, and is loaded without a request
      kOnDisk  ///< it is loaded at its first request
    } where = Where::kOnDisk;
  };
  /// The place of every cell that has a model in force.
  [[nodiscard]] std::map<std::string, Place> places() const;
  /// The number of cells that have a model in force.
  [[nodiscard]] std::size_t cells_served() const;
  [[nodiscard]] std::size_t bytes() const;

  /// Call it before others use the registry. The last source is emptied before the things that it
  /// calls are destroyed.
  void set_source(ModelSource source);
  /// Loads the models that ready() asked for. If there are none, it loads models in force that were
  /// never loaded, while there is room. Returns after `tick` at the latest, or when `stop` is
  /// requested. While one thread calls this repeatedly, ready() does not wait.
  void load_for(const std::stop_token& stop, std::chrono::milliseconds tick);
  /// No thread calls load_for() any longer.
  void stop_loading();
  /// Frees models until `stop` is requested; see reclaimed().
  void free_models(const std::stop_token& stop) { reclaimer_->run(stop); }

 private:
  using Key = std::pair<std::string, int>;
  struct Held {
    ServedModelPtr model;
    std::size_t bytes = 0;
    std::uint64_t used = 0;
  };
  /// The model if it is in memory; counts as a use.
  [[nodiscard]] ServedModelPtr held(const Key& key) const TRAMMEL_REQUIRES(mutex_);
  /// Puts the model into memory. Models that must leave go to `left`, to be freed outside the lock.
  void hold(ServedModelPtr model, std::vector<ServedModelPtr>* left) const TRAMMEL_REQUIRES(mutex_);
  /// The version of the model in force of the cell; null: none.
  [[nodiscard]] const int* place_of(const std::string& cell) const TRAMMEL_REQUIRES(mutex_);
  /// Loads a model after making sure that no other thread does. Empty: another thread has loaded it
  /// meanwhile.
  [[nodiscard]] Result<ServedModelPtr> load(const Key& key) const TRAMMEL_EXCLUDES(mutex_);
  [[nodiscard]] Result<ServedModelPtr> from_source(const Key& key, bool in_force) const;
  void settle(const Key& key, bool in_force, const Result<ServedModelPtr>& loaded) const
      TRAMMEL_REQUIRES(mutex_);
  [[nodiscard]] std::optional<Key> next_to_load() const TRAMMEL_REQUIRES(mutex_);
  /// True if there is room for models that nobody has requested yet.
  [[nodiscard]] bool has_room() const TRAMMEL_REQUIRES(mutex_) {
    return bytes_ < budget_ - budget_ / 8;
  }

  const std::size_t budget_;
  const std::shared_ptr<Reclaimer<ServedModel>> reclaimer_ =
      std::make_shared<Reclaimer<ServedModel>>();
  // The members are a cache of the source, so const functions change them.
  mutable Mutex mutex_;
  mutable Condition changed_;
  ModelSource source_ TRAMMEL_GUARDED_BY(mutex_);
  mutable std::map<std::string, int> in_force_ TRAMMEL_GUARDED_BY(mutex_);
  mutable std::map<Key, Held> held_ TRAMMEL_GUARDED_BY(mutex_);
  mutable std::set<Key> loading_ TRAMMEL_GUARDED_BY(mutex_);
  mutable std::deque<Key> wanted_ TRAMMEL_GUARDED_BY(mutex_);  // requests of callers that do not
                                                               // wait
  mutable std::set<std::string> never_loaded_
      TRAMMEL_GUARDED_BY(mutex_);  // cells whose model was only announced
  mutable std::size_t bytes_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  mutable std::uint64_t uses_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  bool is_loading_ TRAMMEL_GUARDED_BY(mutex_) = false;  // a thread calls load_for()
};

}  // namespace trammel
