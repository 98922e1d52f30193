#include "server/error_sources/catalogue.h"

#include <algorithm>
#include <memory>

#include "server/base/check.h"
#include "server/base/mutex.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

using Records = std::vector<const CauseRecord*>;

Records shipped() {
#define TRAMMEL_LIST_CAUSE(name) &causes::name(),
  return {TRAMMEL_SHIPPED_CAUSES(TRAMMEL_LIST_CAUSE)};
#undef TRAMMEL_LIST_CAUSE
}

/// Readers take the present list; adding a cause replaces it by a new list.
class Catalogue {
 public:
  std::shared_ptr<const Records> records() const {
    const MutexLock lock(mutex_);
    return records_;
  }
  template <typename Change>
  void change(const Change& change) {
    const MutexLock lock(mutex_);
    auto changed = std::make_shared<Records>(*records_);
    change(*changed);
    records_ = std::move(changed);
  }

 private:
  mutable Mutex mutex_;
  std::shared_ptr<const Records> records_ TRAMMEL_GUARDED_BY(mutex_) =
      std::make_shared<Records>(shipped());
};

/// Made at its first use: static initialisers of a program may come first.
Catalogue& catalogue() {
  static Catalogue all;
  return all;
}

bool is_spelled(const CauseRecord& record, std::string_view name) {
  return record.spelling == name ||
         std::any_of(record.forms.begin(), record.forms.end(),
                     [&](const causes::Form& form) { return form.spelling == name; });
}

const CauseRecord* found_in(const Records& records, std::string_view name) {
  const auto found = std::find_if(records.begin(), records.end(),
                                  [&](const CauseRecord* one) { return is_spelled(*one, name); });
  return found == records.end() ? nullptr : *found;
}

}  // namespace

std::vector<const CauseRecord*> all_causes() { return *catalogue().records(); }

const CauseRecord* find_cause(std::string_view spelling) {
  return found_in(*catalogue().records(), spelling.substr(0, spelling.find_first_of(":@")));
}

const CauseRecord& cause_spelled(std::string_view spelling) {
  const CauseRecord* found = find_cause(spelling);
  TRAMMEL_CHECK(found != nullptr);
  return *found;
}

namespace {

/// The first record whose member has that value.
template <typename Value>
const CauseRecord& first_with(Value CauseRecord::*member, Value value) {
  const auto records = catalogue().records();
  const auto found = std::find_if(records->begin(), records->end(),
                                  [&](const CauseRecord* one) { return one->*member == value; });
  TRAMMEL_CHECK(found != records->end());
  return **found;
}

}  // namespace

const CauseRecord& first_searched_by(causes::SearchFamily family) {
  return first_with(&CauseRecord::search, family);
}

const CauseRecord& cause_that_stands_for(causes::StandsFor what) {
  return first_with(&CauseRecord::stands_for, what);
}

const CauseRecord& cause_correcting(causes::Part part) {
  return first_with(&CauseRecord::part, part);
}

namespace {

/// Collects the fields that one record lacks.
class Missing {
 public:
  explicit Missing(const CauseRecord& record) : record_(record) {}

  std::vector<std::string> all() {
    want(!record_.spelling.empty(), "spelling");
    want(!record_.plain_name.empty(), "plain_name");
    want(!record_.shown_by.empty(), "shown_by");
    want(!record_.action.empty(), "action");
    want(record_.told_apart_by.rank > 0 && !record_.told_apart_by.text.empty(), "told_apart_by");
    want(!record_.figures.empty(), "figures");
    for (const causes::Figure& figure : record_.figures)
      want(!figure.name.empty() && !figure.meaning.empty(), "figures: a name and a meaning each");
    want_forms();
    want_rivals();
    want_scope();
    if (record_.added_by_data) want_added(*record_.added_by_data);
    return std::move(missing_);
  }

 private:
  void want(bool there, std::string_view what) {
    if (!there) missing_.emplace_back(what);
  }
  void want_forms() {
    for (const causes::Form& form : record_.forms)
      want(!form.spelling.empty() && form.make != nullptr, "forms: a spelling and a maker each");
    const bool described = record_.search != causes::SearchFamily::kNone &&
                           record_.search != causes::SearchFamily::kPose;
    want(!described || !record_.forms.empty(), "forms: an error source that it is searched by");
    want(record_.forms.empty() || record_.acts.on != causes::ActsOn::kNothing, "acts");
    want(record_.forms.size() < 2 || record_.forms_differ != nullptr, "forms_differ");
  }
  void want_rivals() {
    want(!record_.rivals.empty(), "rivals");
    for (const causes::Rival& rival : record_.rivals)
      want(find_cause(rival.cause) != nullptr,
           fmt::format("rivals: no cause is spelled '{}'", rival.cause));
  }
  void want_scope() {
    want(record_.scope != causes::Scope::kJoint || !record_.plain_name_of_joint.empty(),
         "plain_name_of_joint");
    const bool is_step = record_.lasting == causes::Lasting::kFromAPose;
    want(!is_step || record_.whole_batch.has_value(),
         "whole_batch: what a batch shows that it began before");
    want(!is_step || whole_of(record_) != nullptr,
         "rivals: what it would be from the first pose on");
  }

  void want_added(const causes::AddedByData& added) {
    want(find_cause(added.beside) != nullptr, "added_by_data: the cause that shows it");
    want(added.is_known != nullptr && !added.note.empty(),
         "added_by_data: where it is known, and a note");
  }

  const CauseRecord& record_;
  std::vector<std::string> missing_;
};

}  // namespace

std::vector<std::string> missing_in(const CauseRecord& record) { return Missing(record).all(); }

AddedCause::AddedCause(const CauseRecord& record) : record_(record) {
  catalogue().change([&](Records& records) {
    TRAMMEL_CHECK(found_in(records, record.spelling) == nullptr);
    for (const causes::Form& form : record.forms)
      TRAMMEL_CHECK(found_in(records, form.spelling) == nullptr);
    records.push_back(&record);
  });
}

AddedCause::~AddedCause() {
  catalogue().change([&](Records& records) { std::erase(records, &record_); });
}

}  // namespace trammel
