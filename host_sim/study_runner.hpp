/// Runs the many independent units of a study on all cores, and on several machines under mpirun; what is
/// done is on disk, so that an interrupted study goes on where it stopped.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace sim {

struct StudyWork {
    std::string name;  ///< of the files of results
    /// Everything the numbers of a unit depend on, but for the program itself. Results of another
    /// configuration or build are refused.
    std::string configuration;
    std::size_t units = 0;
    std::function<std::vector<double>(std::size_t unit)> run;  ///< called from several threads at once
};

struct StudyRunOptions {
    std::filesystem::path directory;
    int threads = 0;            ///< 0: the cores of the machine, shared by the processes of mpirun on it
    bool show_progress = true;  ///< on standard error
};

/// This process among those mpirun started; 0 of 1 without mpirun.
struct StudyRank {
    int rank = 0;
    int size = 1;
};

/// Starts MPI if mpirun started this process, and ends it when it goes. Make one, in main.
class StudyRanks {
  public:
    StudyRanks();
    ~StudyRanks();
    StudyRanks(const StudyRanks&) = delete;
    StudyRanks& operator=(const StudyRanks&) = delete;

    [[nodiscard]] StudyRank self() const { return self_; }
    /// The bytes of all processes, one after the other, on process 0; nothing elsewhere.
    [[nodiscard]] std::vector<char> gather(const std::vector<char>& mine) const;
    /// What process 0 has, on all of them; all must call it.
    [[nodiscard]] std::vector<double> spread(std::vector<double> values) const;
    /// Ends all processes, after an error in this one; returns when it is the only one.
    void give_up() const;

  private:
    StudyRank self_;
};

/// The result of each unit, the same whoever computed it and in whatever order; empty on processes other than
/// 0. Unit u is done by process u mod size. Results are appended to `<directory>/<name>.<rank>.runs` as they
/// come; those found in any such file are not computed again. A record that was cut off by a crash is done
/// anew. Throws InputError when the directory cannot be written or holds results of another configuration.
std::vector<std::vector<double>> run_study_units(const StudyWork& work, const StudyRunOptions& options,
                                                 const StudyRanks& ranks);

}  // namespace sim
