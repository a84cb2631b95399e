"""Which language a request is in, and what people are told whose language is not read."""

from functools import lru_cache
from typing import NamedTuple

from py3langid.langid import MODEL_FILE, LanguageIdentifier

READ = "en"
_ENGLISH_AT_MOST = 0.05
"""A request counts as another language's where English is less likely than this."""

SAID = {
    "de": "Ich lese Englisch; bitte schreiben Sie auf Englisch, in welchem Stock das Fenster ist und was dort steht.",
    "fr": "Je lis l'anglais ; merci d'écrire en anglais à quel étage est la fenêtre et ce qu'on y voit.",
    "es": "Leo inglés; por favor, escriba en inglés en qué piso está la ventana y qué se ve en ella.",
    "pt": "Leio inglês; por favor, escreva em inglês em que andar fica a janela e o que se vê nela.",
    "it": "Leggo l'inglese; per favore scriva in inglese a che piano è la finestra e che cosa vi si vede.",
    "zh": "我只能读英文；请用英文写明窗户在几楼，以及窗边能看到什么。",
    "ja": "英語しか読めません。窓が何階にあるか、窓に何が見えるかを英語で書いてください。",
    "ru": "Я читаю по-английски; напишите, пожалуйста, по-английски, на каком этаже окно и что в нём видно.",
    "ar": "أقرأ الإنجليزية؛ يرجى أن تكتب بالإنجليزية في أي طابق تقع النافذة وماذا يُرى عندها.",
    "hi": "मैं अंग्रेज़ी पढ़ता हूँ; कृपया अंग्रेज़ी में लिखें कि खिड़की किस मंज़िल पर है और उस पर क्या दिखता है।",
}
"""That English is read, and what to write, in each language that is recognised."""


class Language(NamedTuple):
    """ISO 639-1, and how likely."""

    code: str
    probability: float


def other_language(text: str) -> Language | None:
    """The language of a text that is not English; null for English, and where there is too little to tell."""
    if sum(c.isalpha() for c in text) < 4:
        return None
    ranked = dict(_identifier().rank(text))
    if ranked[READ] > _ENGLISH_AT_MOST:
        return None
    code = max(ranked, key=lambda c: ranked[c])
    return Language(code, float(ranked[code]))


@lru_cache(maxsize=1)
def _identifier() -> LanguageIdentifier:
    identifier = LanguageIdentifier.from_model_file(MODEL_FILE, norm_probs=True)
    identifier.set_languages([READ, *SAID])
    return identifier
