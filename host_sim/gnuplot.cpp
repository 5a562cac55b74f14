#include "host_sim/gnuplot.hpp"

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <sys/wait.h>
#include <unistd.h>

#include "host_sim/json_fields.hpp"

namespace sim {

void require_gnuplot() {
    const char* path = std::getenv("PATH");
    std::istringstream directories(path == nullptr ? "" : path);
    for (std::string directory; std::getline(directories, directory, ':');)
        if (::access((directory + "/gnuplot").c_str(), X_OK) == 0) return;
    throw InputError("gnuplot is not installed: apt-get install gnuplot-nox");
}

std::filesystem::path run_gnuplot(const std::filesystem::path& directory, const std::string& name,
                                  const std::string& commands, int width, int height) {
    const auto script = directory / (name + ".gp");
    {
        std::ofstream out(script);
        out << "set terminal pngcairo size " << width << ',' << height
            << " font 'sans,12' background '#ffffff'\n"
            << "set output '" << name << ".png'\n"
            << commands;
        if (!out.flush()) throw InputError(script.string() + ": cannot be written");
    }
    const pid_t child = ::fork();
    if (child == 0) {
        if (::chdir(directory.c_str()) == 0) {
            const std::string file = name + ".gp";
            ::execlp("gnuplot", "gnuplot", file.c_str(), static_cast<char*>(nullptr));
        }
        ::_exit(127);
    }
    int status = 0;
    if (child < 0 || ::waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
        throw InputError("gnuplot failed on " + script.string());
    return directory / (name + ".png");
}

}  // namespace sim
