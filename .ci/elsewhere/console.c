/* console FILE PROGRAM ARGUMENTS…: runs a program in a console of its own, and when FILE is there, removes it and presses Ctrl-C in that
 * console, as its user would. Ends with the program's status. A console that is closed is not tried: Wine ends its programs without
 * asking their handlers. */
#include <stdio.h>
#include <windows.h>

int main(int count, char **arguments) {
    if (count < 3) return 99;
    /* What follows FILE, as it was quoted. */
    const char *rest = GetCommandLineA();
    for (int i = 0; i < 2; i++) {
        int quoted = 0;
        while (*rest && (quoted || *rest != ' ')) quoted ^= *rest++ == '"';
        while (*rest == ' ') rest++;
    }
    static char command[32768];
    snprintf(command, sizeof command, "%s", rest);
    STARTUPINFOA start = {.cb = sizeof start, .dwFlags = STARTF_USESTDHANDLES};
    start.hStdInput = GetStdHandle(STD_INPUT_HANDLE);
    start.hStdOutput = GetStdHandle(STD_OUTPUT_HANDLE);
    start.hStdError = GetStdHandle(STD_ERROR_HANDLE);
    PROCESS_INFORMATION process;
    if (!CreateProcessA(NULL, command, NULL, NULL, TRUE, CREATE_NEW_CONSOLE, NULL, NULL, &start, &process)) {
        fprintf(stderr, "cannot start %s: %lu\n", command, GetLastError());
        return 98;
    }
    /* The other ends of the pipes are to see when the program is gone. */
    CloseHandle(start.hStdInput);
    CloseHandle(start.hStdOutput);
    while (WaitForSingleObject(process.hProcess, 5) == WAIT_TIMEOUT) {
        if (GetFileAttributesA(arguments[1]) == INVALID_FILE_ATTRIBUTES) continue;
        DeleteFileA(arguments[1]);
        FreeConsole();
        if (!AttachConsole(process.dwProcessId)) return fprintf(stderr, "no console: %lu\n", GetLastError()), 97;
        /* Not this one. */
        SetConsoleCtrlHandler(NULL, TRUE);
        if (!GenerateConsoleCtrlEvent(CTRL_C_EVENT, 0)) return fprintf(stderr, "not done: %lu\n", GetLastError()), 96;
        FreeConsole();
    }
    DWORD status;
    GetExitCodeProcess(process.hProcess, &status);
    return (int)status;
}
