// Accuracy and speed on this PC, each figure beside its bar. Not part of the tests: times depend on the
// machine.
#include <cstdio>
#include <cstring>

#include "tests/bench/accuracy_association.hpp"
#include "tests/bench/accuracy_dsp.hpp"

int main(int argc, char** argv) {
    const char* what = argc == 2 ? argv[1] : "all";
    const bool all = std::strcmp(what, "all") == 0;
    const bool dsp = all || std::strcmp(what, "dsp") == 0;
    const bool association = all || std::strcmp(what, "association") == 0;
    if (argc > 2 || (!dsp && !association)) {
        std::fprintf(stderr, "usage: radar_bench [all|dsp|association]\n");
        return 1;
    }
    int missed = 0;
    if (association) missed += bench::print(bench::accuracy_association());
    if (dsp) missed += bench::print(bench::accuracy_dsp());
    std::printf("%d missed\n", missed);
    return missed == 0 ? 0 : 2;
}
