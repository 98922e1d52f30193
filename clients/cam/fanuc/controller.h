#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "clients/cam/fanuc/statements.h"
#include "clients/cam/keep.h"
#include "clients/cam/program.h"

/// The parts that all programs of a FANUC controller share.
namespace trammel::cam::fanuc {

/// PR[m] as far as the program sets it: by elements.
struct Register {
  std::array<std::optional<double>, 6> elements;
  std::string changed;  ///< why it is not constant
};

/// `UFRAME[1]=PR[5]`
struct Setting {
  std::string from, where;
  std::size_t file = 0;
  std::string changed = {};  ///< why its value is not constant
};

/// The values that programs give UFRAME[n] or UTOOL[n], or the reason why they are not known.
struct Told {
  std::optional<Pose> X;
  std::string why;
  bool by_program = false;  ///< the programs decide the value, known or not
  std::string where;
  std::string file = {};
  int line = 0;
};

/// The parts that all programs of a controller share.
struct Controller {
  std::map<std::string, Register> registers;
  std::map<std::string, Setting> settings;  ///< of UFRAME[n] and UTOOL[n]
  struct Statements {
    std::string first;  ///< the place of the first one
    int count = 0;
  };
  std::map<std::string, Statements> loads;  ///< of PAYLOAD[n]
  ListedValues system;                      ///< UFRAME[n] and UTOOL[n] of the system variables
  std::set<std::string> programs;           ///< the names of the programs that are read

  /// Records `PR[5,1]=100` or `PR[5]=LPOS` in the file of that number.
  void note_register(const Assignment& set, const std::string& where, std::size_t file);
  /// A frame or tool by its number.
  [[nodiscard]] ProgramFrame frame_of(const std::string& number_text, const ReadOptions& options);
  /// `file`: the file of its program.
  [[nodiscard]] ProgramTool tool_of(const std::string& number_text, const ReadOptions& options,
                                    const std::string& file);

 private:
  [[nodiscard]] const Setting* setting_of(const std::string& name) const;
  [[nodiscard]] const Register* register_of(const std::string& name) const;
  [[nodiscard]] Told setting(const std::string& name);
  [[nodiscard]] Told by_system(const std::string& name);
};

}  // namespace trammel::cam::fanuc
