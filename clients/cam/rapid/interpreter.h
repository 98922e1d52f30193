#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <unordered_map>
#include <utility>
#include <vector>

#include "clients/cam/program.h"
#include "clients/cam/rapid/syntax.h"

/// The values of the expressions of a RAPID program, as far as they are constant.
namespace trammel::cam::rapid {

/// A value, or one clause with the reason why the program decides it at run time.
template <typename T>
using Told = tl::expected<T, std::string>;
[[nodiscard]] inline tl::unexpected<std::string> because(std::string why) {
  return tl::make_unexpected(std::move(why));
}

/// The scope of a name: a routine of a module, and the call that entered it.
struct Scope {
  std::size_t module = 0;
  int routine = -1;
  const Instruction* call = nullptr;  ///< the call with the arguments; nullptr: not known
  const Scope* caller = nullptr;      ///< of `call`
};

/// An expression in the program, with the scope of its names.
struct Data {
  const Expression* node = nullptr;
  const Scope* scope = nullptr;
  std::string type;
  const Declaration* declared = nullptr;  ///< nullptr: stands in an instruction
};

/// A robtarget.
struct TargetValue {
  std::vector<double> numbers;       ///< x y z mm, w x y z
  std::array<double, 4> conf{};      ///< cf1 cf4 cf6 cfx
  std::array<double, 6> external{};  ///< 9E9: none
  int decimals = 0;                  ///< of its positions as written
  int rotation_decimals = 0;
};

struct JointValue {
  std::vector<double> axes;  ///< deg
  std::array<double, 6> external{};
  int decimals = 0;
};

/// The valid assignments to tools and work objects, by their part (`tframe.trans` as the numbers of
/// its fields); nullptr: they differ between paths.
using Settings =
    std::map<const Declaration*, std::map<std::vector<std::size_t>, const Assignment*>>;

constexpr double kNoAxis = 8.9e9;  ///< an external axis that is at 9E9 is not there

/// The name whose value an expression is a part of; nullptr: of none.
[[nodiscard]] const Expression* name_in(const Expression& expression);

/// Instructions of the controller that neither move the robot nor change the data which they are
/// given.
[[nodiscard]] bool is_still(const std::string& instruction);

class Interpreter {
 public:
  /// `set_elsewhere`: persistents set by tasks that are not read, in lower case, with their places.
  Interpreter(const std::vector<SourceFile>& files, const std::vector<Module>& modules,
              std::map<std::string, std::string> set_elsewhere = {});

  struct Found {
    const Declaration* declaration = nullptr;
    std::size_t module = 0;
  };
  /// The declaration of a name: in the routine, in the module, or in another module where it is not
  /// local.
  [[nodiscard]] std::optional<Found> find(const std::string& name, const Scope& scope) const;
  /// The routine with that name when called from a module: its module and number.
  [[nodiscard]] std::optional<std::pair<std::size_t, int>> find_routine(const std::string& name,
                                                                        std::size_t module) const;
  /// All paths into a routine, at most some thousand; one path for a routine without parameters.
  [[nodiscard]] const std::vector<const Scope*>& scopes_of(std::size_t module, int routine);

  /// The reason why a declared value may change at run time; empty if it never changes.
  [[nodiscard]] std::string changed(const Declaration* declaration) const;
  /// The persistents that these modules set and that other tasks may share, in lower case, with
  /// their places.
  [[nodiscard]] std::map<std::string, std::string> set_for_all_tasks() const;
  /// The place where a tool's load is measured at run time (LoadId); empty: nowhere.
  [[nodiscard]] std::string load_found(const Declaration* tool) const;

  /// True if an assignment gives a tool or work object a constant, which holds until the next one.
  [[nodiscard]] bool sets(const Assignment& assignment) const {
    return parts_.contains(&assignment);
  }
  void set(const Assignment& assignment, Settings& settings) const;
  /// Sets the settings for the expressions that are evaluated next.
  void assume(const Settings& settings) { now_ = &settings; }

  /// The value of an expression: its literal. Several where an index is not constant.
  [[nodiscard]] Told<std::vector<Data>> data_of(const Expression& expression, const Scope& scope,
                                                int depth = 0) const;
  [[nodiscard]] Told<double> number_of(const Expression& expression, const Scope& scope,
                                       int depth = 0) const;
  [[nodiscard]] Told<TargetValue> target_of(const Expression& expression, const Scope& scope,
                                            int depth = 0) const;
  [[nodiscard]] Told<JointValue> joints_of(const Expression& expression, const Scope& scope) const;
  /// `count` numbers of an aggregate or of a name for one; `decimals`: raised to the largest number
  /// of written decimals.
  [[nodiscard]] Told<std::vector<double>> numbers_of(const Expression& expression,
                                                     std::size_t count, const Scope& scope,
                                                     int* decimals, int depth = 0) const;
  /// The type of the expression's value; empty: not known.
  [[nodiscard]] std::string type_of(const Expression& expression, const Scope& scope,
                                    int depth = 0) const;
  /// The argument that a parameter stands for; `expression` itself where it is none.
  [[nodiscard]] Told<std::pair<const Expression*, const Scope*>> handed_over(
      const Expression& expression, const Scope& scope) const;

  [[nodiscard]] std::string text_of(const Expression& expression, const Scope& scope) const;
  [[nodiscard]] std::string place_of(std::size_t module, int line) const;

 private:
  void note_changes();
  void note_changes_by_tasks();
  void note_changes_by_name(std::size_t module, const Instruction& instruction);
  /// The declaration in one task, where there are several.
  [[nodiscard]] std::optional<Found> find_global(const std::string& name, std::size_t module) const;
  [[nodiscard]] static bool is_shared(const Declaration& declared);
  void note_twice(std::size_t module, const Declaration& one, const Declaration& other);
  void note_change(const Expression& target, const Scope& scope, const std::string& why);
  /// A part of a tool or work object in the same module to which a constant is assigned.
  struct Part {
    const Declaration* of = nullptr;
    std::vector<std::size_t> fields;
  };
  [[nodiscard]] std::optional<Part> constant_part(const Assignment& assignment,
                                                  std::size_t module) const;
  [[nodiscard]] std::optional<std::vector<std::size_t>> fields_of(const Expression& target,
                                                                  const std::string& type,
                                                                  std::size_t module) const;
  [[nodiscard]] Told<const Expression*> as_set(const Declaration& declared) const;
  void note_changes_by(std::size_t module, const Instruction& instruction);
  [[nodiscard]] const Scope* own_scope(std::size_t module, int routine);
  [[nodiscard]] Told<const Expression*> bound(const Declaration& parameter,
                                              const Scope& scope) const;
  [[nodiscard]] Told<std::vector<Data>> field_of(const Expression& expression, const Scope& scope,
                                                 int depth) const;
  [[nodiscard]] Told<std::vector<Data>> element_of(const Expression& expression, const Scope& scope,
                                                   int depth) const;
  [[nodiscard]] Told<TargetValue> offset_of(const Expression& call, const Scope& scope,
                                            int depth) const;
  [[nodiscard]] Told<double> operation(const Expression& expression, const Scope& scope,
                                       int depth) const;
  struct Field {
    std::size_t index = 0;
    std::string type;
  };
  [[nodiscard]] std::optional<Field> field(const std::string& type, const std::string& name,
                                           std::size_t module) const;

  const std::vector<SourceFile>& files_;
  const std::vector<Module>& modules_;
  std::vector<std::map<std::pair<int, std::string>, const Declaration*>> by_name_;
  std::vector<std::string> tasks_;                    ///< of the modules
  std::map<std::string, std::vector<Found>> global_;  ///< by name, in the order of the modules
  std::map<std::string, std::string> set_elsewhere_;
  std::map<const Declaration*, std::string> load_found_;
  std::unordered_map<std::string, std::vector<std::pair<std::size_t, int>>>
      routines_;  ///< by name, in their order
  std::map<const Declaration*, std::string> changed_;
  std::map<const Declaration*, std::string>
      set_in_order_;  ///< the places of variables that only get constants
  std::map<const Assignment*, Part> parts_;
  const Settings* now_ = nullptr;
  mutable std::map<std::pair<const Declaration*, Settings::mapped_type>,
                   std::unique_ptr<Expression>>
      as_set_;
  std::vector<std::unique_ptr<Scope>> scopes_;
  std::map<std::pair<std::size_t, int>, std::vector<const Scope*>> ways_in_;
  std::map<std::pair<std::size_t, int>, const Scope*> own_;
};

}  // namespace trammel::cam::rapid
