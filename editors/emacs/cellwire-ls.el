;;; cellwire-ls.el --- FANUC LS files, by the language server of cellwire  -*- lexical-binding: t; -*-
;; In the init file: (load "…/cellwire-ls.el"). Needs eglot: a part of Emacs 29, a package before.

(require 'eglot)

(defvar cellwire-ls-keywords
  '(("^/\\(PROG\\|ATTR\\|APPL\\|MN\\|POS\\|END\\)\\>" . font-lock-keyword-face)
    ("^ *[0-9]*: *\\(\\(?:!\\|--\\|//\\).*?\\) *;? *$" 1 font-lock-comment-face)
    ("^ *[0-9]*: *\\([JLCAS]\\) " 1 font-lock-keyword-face)
    ("\\<\\(IF\\|THEN\\|ELSE\\|ENDIF\\|SELECT\\|FOR\\|TO\\|DOWNTO\\|ENDFOR\\|JMP\\|LBL\\|CALL\\|RUN\\|WAIT\\|END\\|ABORT\\|PAUSE\\)\\>" . font-lock-keyword-face)
    ("\\<\\([A-Z]+\\)\\[" 1 font-lock-variable-name-face))
  "Colours of LS files.")

(define-derived-mode cellwire-ls-mode prog-mode "LS"
  "FANUC teach pendant programs as text."
  (setq-local indent-tabs-mode t)
  (setq-local font-lock-defaults '(cellwire-ls-keywords)))

(add-to-list 'auto-mode-alist '("\\.[lL][sS]\\'" . cellwire-ls-mode))
(add-to-list 'eglot-server-programs '(cellwire-ls-mode . ("cellwire" "ls" "lsp")))
(add-hook 'cellwire-ls-mode-hook #'eglot-ensure)
