/* waits PERIOD_MS COUNT: an empty loop that wakes in a period, by the timer that Rust's sleep has, and how late it is: what the system
 * adds to a cycle before any program of this project has done anything. */
#include <stdio.h>
#include <stdlib.h>
#include <windows.h>

static int compare(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int count, char **arguments) {
    double period = count > 1 ? atof(arguments[1]) : 8;
    int times = count > 2 ? atoi(arguments[2]) : 1000;
    SetThreadPriority(GetCurrentThread(), THREAD_PRIORITY_TIME_CRITICAL);
    HANDLE timer = CreateWaitableTimerExW(NULL, NULL, 2 /* high resolution */, TIMER_ALL_ACCESS);
    if (!timer) timer = CreateWaitableTimerExW(NULL, NULL, 0, TIMER_ALL_ACCESS);
    LARGE_INTEGER frequency, now, begin;
    QueryPerformanceFrequency(&frequency);
    double *late = calloc(times, sizeof *late);
    QueryPerformanceCounter(&begin);
    for (int i = 0; i < times; i++) {
        double due = (i + 1) * period;
        QueryPerformanceCounter(&now);
        double left = due - (now.QuadPart - begin.QuadPart) * 1e3 / frequency.QuadPart;
        if (left > 0) {
            LARGE_INTEGER relative = {.QuadPart = -(LONGLONG)(left * 1e4)};
            SetWaitableTimer(timer, &relative, 0, NULL, NULL, FALSE);
            WaitForSingleObject(timer, INFINITE);
        }
        QueryPerformanceCounter(&now);
        late[i] = (now.QuadPart - begin.QuadPart) * 1e3 / frequency.QuadPart - due;
    }
    qsort(late, times, sizeof *late, compare);
    const double limits[] = {0.1, 0.2, 0.5, 1, 2, 5, 10, 20};
    int at = 0;
    for (unsigned k = 0; k <= sizeof limits / sizeof *limits; k++) {
        int from = at;
        while (at < times && (k == sizeof limits / sizeof *limits || late[at] < limits[k])) at++;
        if (k < sizeof limits / sizeof *limits) printf("late < %4.1f ms %6d\n", limits[k], at - from);
        else printf("more           %6d\n", at - from);
    }
    printf("p50 %.3f p99 %.3f max %.3f ms of %d waits of %.1f ms\n", late[times / 2], late[times * 99 / 100], late[times - 1], times, period);
    return 0;
}
